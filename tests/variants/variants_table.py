"""The table of variants, by section of docs/logs.md."""

from camera_rows import CAMERA_ROWS
from choice_rows import CHOICE_ROWS
from color_rows import COLOR_ROWS
from container_rows import CONTAINER_ROWS
from depth_rows import DEPTH_ROWS
from family_rows import FAMILIES
from label_rows import CLASS_TABLES, LABELS_ENCODED
from pose_rows import POSE_ROWS
from variant import Variant

SECTIONS: dict[str, tuple[Variant, ...]] = {
    "Families": FAMILIES,
    "Choice of channels": CHOICE_ROWS,
    "Colour": COLOR_ROWS,
    "Depth": DEPTH_ROWS,
    "Calibration": CAMERA_ROWS,
    "Poses": POSE_ROWS,
    "Labels": LABELS_ENCODED,
    "Class tables": CLASS_TABLES,
    "Containers": CONTAINER_ROWS,
}
VARIANTS: dict[str, Variant] = {variant.name: variant for rows in SECTIONS.values() for variant in rows}
