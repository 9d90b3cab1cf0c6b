"""Map files: another reader finds the same points, and the bytes depend on nothing else."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

from stsem.chance import generator
from stsem.classes import ClassSet
from stsem.errors import OutputError
from stsem.mapping.cloud import LabelledPoints
from stsem.mapping.ply import ply_bytes, write_ply

CLASSES = ClassSet(("wall", "rubbish bin", "Tür\n1"), ((10, 20, 30), (40, 50, 60), (255, 0, 1)))


def cloud(n: int) -> LabelledPoints:
    rng = generator(0, "cloud")
    return LabelledPoints(rng.normal(0, 5, (n, 3)), np.zeros((n, 3), np.uint8), rng.integers(0, 3, n).astype(np.uint8))


def test_another_reader_finds_the_same_points(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    points = cloud(1000)
    write_ply(tmp_path / "map.ply", points, CLASSES)
    read = trimesh.load(tmp_path / "map.ply")
    np.testing.assert_array_equal(np.asarray(read.vertices, np.float32), points.xyz.astype(np.float32))
    np.testing.assert_array_equal(np.asarray(read.colors)[:, :3], CLASSES.palette()[points.labels])
    vertices = read.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(np.asarray(vertices["label"]).ravel(), points.labels)


def test_the_header_names_frame_unit_and_classes() -> None:
    header = ply_bytes(cloud(2), CLASSES).split(b"end_header\n")[0].decode("ascii").splitlines()
    assert header == [
        "ply",
        "format binary_little_endian 1.0",
        "comment frame: world, metres",
        "comment class 0 wall",
        "comment class 1 rubbish bin",
        "comment class 2 T\\xfcr\\n1",
        "element vertex 2",
        "property float x",
        "property float y",
        "property float z",
        "property uchar red",
        "property uchar green",
        "property uchar blue",
        "property uchar label",
    ]


def test_the_bytes_are_fixed() -> None:
    points = LabelledPoints(np.array([[1.0, -2.5, 0.125]]), np.zeros((1, 3), np.uint8), np.array([2], np.uint8))
    data = ply_bytes(points, CLASSES)
    assert data.endswith(b"end_header\n" + bytes.fromhex("0000803f 000020c0 0000003e ff0001 02"))
    assert len({hashlib.sha256(ply_bytes(cloud(50), CLASSES)).digest() for _ in range(3)}) == 1


def test_an_empty_map_is_a_file_too(tmp_path: Path) -> None:
    write_ply(tmp_path / "map.ply", cloud(0), CLASSES)
    assert (tmp_path / "map.ply").read_bytes().endswith(b"property uchar label\nend_header\n")


def test_a_path_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="The map cannot be written to"):
        write_ply(tmp_path / "none" / "map.ply", cloud(1), CLASSES)
