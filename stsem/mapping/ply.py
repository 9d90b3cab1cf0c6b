"""Point clouds as PLY files (binary, little endian): x y z, red green blue, label."""

from pathlib import Path

import numpy as np

from stsem.classes import ClassSet
from stsem.errors import OutputError
from stsem.mapping.cloud import LabelledPoints

VERTEX = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3), ("label", "u1")])


def ply_bytes(points: LabelledPoints, classes: ClassSet) -> bytes:
    """The file: metres as float32, the colour of the class, its id; the class names stand in comments."""
    lines = ["ply", "format binary_little_endian 1.0", "comment frame: world, metres"]
    lines += [f"comment class {i} {_plain(name)}" for i, name in enumerate(classes.names)]
    lines += [f"element vertex {len(points)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue", "label")]
    vertices = np.empty(len(points), VERTEX)
    vertices["xyz"], vertices["label"] = points.xyz, points.labels
    vertices["rgb"] = classes.palette()[points.labels]
    return ("\n".join([*lines, "end_header"]) + "\n").encode("ascii") + vertices.tobytes()


def write_ply(path: Path, points: LabelledPoints, classes: ClassSet) -> None:
    """Write `ply_bytes` to `path`.

    Raises:
        OutputError: it cannot be written.
    """
    try:
        path.write_bytes(ply_bytes(points, classes))
    except OSError as err:
        raise OutputError(f"The map cannot be written to {path}: {err.strerror}; choose another path.") from err


def _plain(name: str) -> str:
    """One line of ASCII."""
    return " ".join(name.split()).encode("ascii", "backslashreplace").decode("ascii")
