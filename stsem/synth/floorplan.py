"""Where the walls of an office floor stand: a corridor along x with two rooms on either side."""

from dataclasses import dataclass

import numpy as np

from stsem.chance import generator

WALL_THICKNESS = 0.12
CEILING = 2.7
DOOR_WIDTH = 0.95
DOOR_HEIGHT = 2.08

Opening = tuple[float, float, float, float]
"""x0, x1, z0, z1 on a wall, metres in the wall's frame."""


@dataclass(frozen=True)
class Room:
    """One room. Its local frame has the corridor wall on y = 0, windows on y = depth and x in [0, width].

    Args:
        index: position in the plan.
        origin: (x, y) of the local frame in the world.
        yaw: 0 for rooms north of the corridor, pi for those south of it.
        width, depth: metres.
        door_x: left edge of the door in the local frame.
        hinge_left: whether the leaf turns about the door's left edge.
        angle: how far the door stands open, radians; 0 is closed.
        windows: openings on the back wall, in that wall's frame.
    """

    index: int
    origin: tuple[float, float]
    yaw: float
    width: float
    depth: float
    door_x: float
    hinge_left: bool
    angle: float
    windows: tuple[Opening, ...]

    @property
    def is_open(self) -> bool:
        """Whether somebody can walk in."""
        return self.angle > 0

    def to_world(self, x: float, y: float) -> tuple[float, float]:
        """World (x, y) of a point of the local frame."""
        sign = 1.0 if self.yaw == 0 else -1.0
        return self.origin[0] + sign * x, self.origin[1] + sign * y


@dataclass(frozen=True)
class FloorPlan:
    """The corridor (x in [0, length], y in [0, width]) and its rooms."""

    length: float
    width: float
    rooms: tuple[Room, ...]


def draw_plan(layout: int) -> FloorPlan:
    """The plan of `layout`: sizes, doors (one of four closed) and windows."""
    rng = generator(layout, "plan")
    width = float(rng.uniform(2.0, 2.5))
    length = float(rng.uniform(8.6, 10.6))
    closed = int(rng.integers(4))
    rooms = []
    for side in range(2):
        split = length * float(rng.uniform(0.45, 0.55))
        spans = ((0.0, split - WALL_THICKNESS / 2), (split + WALL_THICKNESS / 2, length))
        for k, (x0, x1) in enumerate(spans):
            index = 2 * side + k
            origin = (x0, width + WALL_THICKNESS) if side == 0 else (x1, -WALL_THICKNESS)
            rooms.append(_room(rng, index, origin, np.pi * side, x1 - x0, index == closed))
    return FloorPlan(length, width, tuple(rooms))


def _room(
    rng: np.random.Generator, index: int, origin: tuple[float, float], yaw: float, width: float, closed: bool
) -> Room:
    depth = float(rng.uniform(4.0, 5.0))
    hinge_left = bool(rng.random() < 0.5)
    gap = float(rng.uniform(0.22, 0.5))
    door_x = gap if hinge_left else width - gap - DOOR_WIDTH
    angle = 0.0 if closed else float(np.radians(rng.uniform(78, 96)))
    return Room(index, origin, yaw, width, depth, door_x, hinge_left, angle, _windows(rng, width))


def _windows(rng: np.random.Generator, width: float) -> tuple[Opening, ...]:
    sill, head = float(rng.uniform(0.8, 1.0)), float(rng.uniform(2.15, 2.4))
    if rng.random() < 0.5:
        w = float(rng.uniform(1.6, 2.4))
        x = float(rng.uniform(0.5, width - w - 0.5))
        return ((x, x + w, sill, head),)
    w = float(rng.uniform(1.1, 1.4))
    first = float(rng.uniform(0.3, width / 2 - w - 0.15))
    second = float(rng.uniform(width / 2 + 0.15, width - w - 0.3))
    return ((first, first + w, sill, head), (second, second + w, sill, head))
