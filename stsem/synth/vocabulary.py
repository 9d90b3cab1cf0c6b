"""The thirteen classes of the paper's office, in its order; the position is the id in every label image."""

from enum import IntEnum

from stsem.classes import ClassSet


class Label(IntEnum):
    """Class ids of rendered logs."""

    WALL = 0
    CEILING = 1
    FLOOR = 2
    LAMP = 3
    DESK = 4
    PERSON = 5
    CHAIR = 6
    PC = 7
    DOOR = 8
    PAINTING = 9
    WINDOWS = 10
    CUPBOARD = 11
    RUBBISH_BIN = 12


OFFICE = ClassSet(
    names=(
        "wall", "ceiling", "floor", "lamp", "desk", "person", "chair",
        "PC", "door", "painting", "windows", "cupboard", "rubbish bin",
    ),
    colours=(
        (174, 199, 232), (120, 120, 130), (152, 223, 138), (255, 220, 40), (247, 182, 110), (220, 30, 60),
        (140, 86, 200), (30, 60, 200), (150, 90, 50), (240, 110, 220), (60, 200, 230), (90, 130, 60), (0, 130, 120),
    ),
)  # fmt: skip
"""Names and colours of the classes of rendered logs."""
