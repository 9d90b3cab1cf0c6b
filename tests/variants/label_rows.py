"""Labels: ids, pngs, palettes and colours of any size; and class tables wherever they may stand."""

import json
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from typing import Any

import numpy as np
from analytic_scene import CLASSES, COLOURS, Scene, View
from color_rows import raw as raw_color
from encoders_ros import NS
from family_rows import FOX
from image_messages import encoded
from PIL import Image as PilImage
from tape import LABELS, Part, Tape, class_metadata, class_names, ids, images, labels, nothing
from variant import Equal, Variant, rows

Array = np.ndarray[Any, Any]
HEX = tuple("#{:02x}{:02x}{:02x}".format(*colour) for colour in COLOURS)
NAMED_COLOURS = {name: f"{code} {i}" for i, (name, code) in enumerate(zip(CLASSES, HEX, strict=True))}
GAPS = (3, 7, 8, 40, 90, 250)
"""Ids of the classes in logs whose numbers have gaps."""
WIDE = (3, 700, 8000, 8001, 30_000, 60_000)


def raw(pixels: Callable[[View], Array], encoding: str, **options: Any) -> Part:
    """Labels as raw images."""
    return labels(lambda make, t, view: make.image(t, pixels(view), encoding, **options))


def png(data: Callable[[View], bytes], topic: str = f"{LABELS}/compressed") -> Part:
    """Labels as pngs."""
    return labels(lambda make, t, view: make.compressed(t, data(view), "png"), topic)


def numbered(numbers: tuple[int, ...], ignored: int, dtype: str) -> Callable[[View], Array]:
    """Labels in other numbers."""
    table = np.full(256, ignored, np.uint16)
    table[: len(numbers)] = numbers
    return lambda view: table[view.labels].astype(dtype)


def coloured(view: View) -> Array:
    """Labels in their colours; what is ignored in a colour of no class."""
    table = np.zeros((256, 3), np.uint8)
    table[: len(COLOURS)] = COLOURS
    return table[view.labels]


def painted(view: View) -> View:
    """A view whose colours are its labels."""
    return replace(view, rgb=coloured(view))


def _palette_png(view: View, palette: tuple[tuple[int, int, int], ...], numbers: Array) -> bytes:
    image = PilImage.fromarray(numbers[view.labels], "P")
    image.putpalette([value for colour in palette for value in colour])
    stream = BytesIO()
    image.save(stream, "PNG")
    return stream.getvalue()


def _indexed(view: View) -> bytes:
    """Indices are ids; the palette is anything."""
    return _palette_png(view, tuple((i, i, i) for i in range(256)), np.arange(256, dtype=np.uint8))


def _class_palette(view: View) -> bytes:
    """Colours are those of the classes, indices stand in another order."""
    return _palette_png(view, COLOURS[::-1], np.arange(len(CLASSES), dtype=np.uint8)[::-1])


def _twice(view: View) -> Array:
    return np.ascontiguousarray(view.labels.repeat(2, 0).repeat(2, 1))


def _stamped_late(late_ns: int) -> Part:
    return labels(lambda make, t, view: ids(make, t + late_ns, view))


def _all_at_the_end(make: Any, scene: Scene) -> Tape:
    """Written by a network that went over the log afterwards."""
    end = scene.stamp_ns(scene.frames) + 20 * NS
    found = labels(ids)(make, scene).messages
    return Tape(tuple(replace(message, log_ns=end + k) for k, message in enumerate(found)))


def names_at(numbers: tuple[int, ...]) -> dict[str, str]:
    """Id -> name."""
    return {str(number): name for number, name in zip(numbers, CLASSES, strict=True)}


def attached(table: Any) -> Part:
    """The attachment classes.json."""
    return lambda make, scene: Tape(attachments={"classes.json": json.dumps(table).encode()})


IN_COLOUR = class_metadata(NAMED_COLOURS)
UNKNOWN = Equal(warns=("1077 pixels in 12 label images have an id or colour outside the class table: ignored.",))
LABELS_ENCODED = (
    Variant("labels-mono8", "`mono8` ids, 255 ignored", labels=raw(lambda v: v.labels, "mono8")),
    Variant("labels-8UC1", "`8UC1` ids", labels=raw(lambda v: v.labels, "8UC1")),
    Variant("labels-16UC1", "`16UC1` ids", labels=raw(lambda v: v.labels.astype("<u2"), "16UC1")),
    Variant("labels-mono16", "`mono16` ids, big endian", labels=raw(lambda v: v.labels.astype(">u2"), "mono16")),
    Variant("labels-32SC1", "`32SC1` ids", labels=raw(lambda v: v.labels.astype("<i4"), "32SC1")),
    Variant("labels-padding", "rows filled up by 3 bytes", labels=raw(lambda v: v.labels, "mono8", padding=3)),
    Variant("labels-png", "grey png of 8 bits", labels=png(lambda v: encoded(".png", v.labels))),
    Variant("labels-png-16-bit", "grey png of 16 bits",
            labels=png(lambda v: encoded(".png", v.labels.astype(np.uint16)))),
    Variant("labels-png-palette", "png with a palette: its indices", labels=png(_indexed)),
    *rows(
        (
            Variant("labels-png-class-palette", "png with the classes' colours as its palette: the colours",
                    labels=png(_class_palette), scene=Scene(poster=False)),
            Variant("labels-rgb8", "colours of the class table, `rgb8`", equal=UNKNOWN,
                    labels=labels(lambda make, t, v: raw_color("rgb8")(make, t, painted(v)))),
            Variant("labels-bgra8", "the same in `bgra8`", equal=UNKNOWN,
                    labels=labels(lambda make, t, v: raw_color("bgra8")(make, t, painted(v)))),
            Variant("labels-png-colours", "the same in a png", equal=UNKNOWN,
                    labels=png(lambda v: encoded(".png", coloured(v)))),
        ),
        classes=IN_COLOUR,
    ),
    Variant("labels-twice-the-size", "twice as many pixels each way as colour", labels=raw(_twice, "mono8"),
            equal=Equal(pixels=4)),
    Variant("labels-gaps", "ids with gaps", labels=raw(numbered(GAPS, 255, "u1"), "mono8"),
            classes=class_metadata(names_at(GAPS))),
    Variant("labels-above-255", "ids above 255", labels=raw(numbered(WIDE, 255, "<u2"), "16UC1"),
            classes=class_metadata(names_at(WIDE))),
    Variant("labels-unknown-ids", "ids outside the class table: ignored, counted, and said",
            labels=raw(numbered(tuple(range(6)), 77, "u1"), "mono8"), equal=UNKNOWN),
    Variant("labels-own-ignored", "an ignored id of its own in the class table",
            labels=raw(numbered(tuple(range(6)), 77, "u1"), "mono8"),
            classes=attached({"names": list(CLASSES), "ignore_id": 77})),
    Variant("labels-stamps-apart", "label stamps 4 ms behind those of colour: the nearest, and said",
            labels=_stamped_late(4_000_000),
            equal=Equal(warns=("12 label images have no colour image of exactly their stamp",))),
    Variant("labels-late", "logged when everything was over: the delay is taken out, and said", labels=_all_at_the_end,
            equal=Equal(warns=("The clock of /gt/labels is off",))),
    Variant("labels-sparse", "every third frame is labelled", scene=Scene(labelled=(1, 4, 7, 10))),
    Variant("labels-sparse-protobuf", "the same in protobuf as png", make=FOX, scene=Scene(labelled=(1, 4, 7, 10)),
            labels=images(f"{LABELS}/png", 20_000_000, only_labelled=True,
                          draw=lambda make, t, v: make.compressed(t, encoded(".png", v.labels), "png"))),
)  # fmt: skip
CLASS_TABLES = (
    Variant("classes-label-info", "a vision_msgs/LabelInfo message", classes=class_names),
    Variant("classes-metadata", "metadata `stsem.classes`: id -> name",
            classes=class_metadata(names_at(tuple(range(6))))),
    Variant("classes-metadata-colours", "metadata `stsem.classes`: name -> `#rrggbb id`", classes=IN_COLOUR),
    Variant("classes-attachment", "attachment `classes.json`: a list of names", classes=attached(list(CLASSES))),
    Variant("classes-attachment-colours", "attachment with names, colours and the ignored id",
            classes=attached({"names": list(CLASSES), "colours": [list(c) for c in COLOURS], "ignore_id": 255})),
    Variant("classes-attachment-hex", "attachment with `#rrggbb` by id", classes=attached(
        {"names": names_at(tuple(range(6))), "colors": {str(i): code for i, code in enumerate(HEX)}})),
    Variant("classes-file-json", "`--classes FILE.json`", classes=nothing,
            classes_file=("classes.json", json.dumps(list(CLASSES)))),
    Variant("classes-file-toml", "`--classes FILE.toml` over what the log says",
            classes=class_metadata({"0": "nonsense"}),
            classes_file=("classes.toml", "".join(f'{i} = "{name}"\n' for i, name in enumerate(CLASSES)))),
    Variant("classes-twice", "two tables that agree, one with colours",
            classes=lambda make, scene: class_names(make, scene) + IN_COLOUR(make, scene)),
)  # fmt: skip
