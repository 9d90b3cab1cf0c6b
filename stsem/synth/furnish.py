"""Puts furniture into rooms and corridor without overlaps, and remembers what is worth looking at."""

from dataclasses import dataclass, field

import numpy as np

from stsem.synth import furniture
from stsem.synth.building import wall_frames
from stsem.synth.floorplan import CEILING, DOOR_WIDTH, FloorPlan, Room
from stsem.synth.mesh import F64, Builder
from stsem.synth.palette import Palette
from stsem.synth.patterns import Rng
from stsem.synth.vocabulary import Label

Rect = tuple[float, float, float, float]
"""x0, y0, x1, y1 in the world, metres."""


@dataclass(frozen=True)
class Target:
    """Something to look at: its class, its centre in the world, and the room it is in (None: the corridor)."""

    label: Label
    point: tuple[float, float, float]
    room: int | None


@dataclass(frozen=True)
class Light:
    """A luminaire or a window: `power` RGB; with `facing` it shines like a panel, without it in all directions."""

    position: tuple[float, float, float]
    size: tuple[float, float, float]
    power: tuple[float, float, float]
    facing: tuple[float, float, float] | None = None


@dataclass
class Furnishing:
    """What has been placed so far: obstacles on the floor, ways to keep clear, targets, lights, spots for persons."""

    obstacles: list[Rect] = field(default_factory=list)
    clear: list[Rect] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    standing: list[tuple[float, float, float]] = field(default_factory=list)

    def claim(self, frame: Builder, x: tuple[float, float], y: tuple[float, float], margin: float = 0.04) -> bool:
        """Take a rectangle of `frame` if nothing stands there and nobody must pass; says whether it worked."""
        rect = world_rect(frame, x, y)
        wide = (rect[0] - margin, rect[1] - margin, rect[2] + margin, rect[3] + margin)
        if any(overlap(wide, other) for other in self.obstacles) or any(overlap(rect, other) for other in self.clear):
            return False
        self.obstacles.append(rect)
        return True


def overlap(a: Rect, b: Rect) -> bool:
    """Whether two rectangles share area."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def world_rect(frame: Builder, x: tuple[float, float], y: tuple[float, float]) -> Rect:
    """World rectangle of a rectangle in a frame turned by a multiple of 90 degrees."""
    a, b = frame.world((x[0], y[0], 0)), frame.world((x[1], y[1], 0))
    return float(min(a[0], b[0])), float(min(a[1], b[1])), float(max(a[0], b[0])), float(max(a[1], b[1]))


def as_point(vector: F64) -> tuple[float, float, float]:
    """(3,) array as a tuple of floats."""
    return float(vector[0]), float(vector[1]), float(vector[2])


@dataclass
class RoomFurnisher:
    """Furnishes one room; `inside` is its local frame."""

    inside: Builder
    room: Room
    palette: Palette
    rng: Rng
    into: Furnishing

    def __post_init__(self) -> None:
        self.walls = wall_frames(self.inside, self.room.width, self.room.depth)
        self.used: dict[str, list[tuple[float, float]]] = {name: [] for name in self.walls}
        self.used["back"] += [(x0 - 0.05, x1 + 0.05) for x0, x1, _, _ in self.room.windows]
        left = self.room.width - self.room.door_x - DOOR_WIDTH
        self.used["front"].append((left - 0.15, left + DOOR_WIDTH + 0.15))
        hinge = "left" if self.room.hinge_left else "right"
        near = (0.0, 1.15) if hinge == "left" else (self.room.depth - 1.15, self.room.depth)
        self.used[hinge].append(near)
        self._keep_ways_clear()

    def furnish(self) -> None:
        """Desks first, then what needs less room."""
        rng = self.rng
        walls = ["left", "right", "back"]
        order = [walls[k] for k in rng.permutation(3)]
        desks = sum(self._workplace(name) for name in order)
        for name in ("front", *order):
            if rng.random() < 0.8:
                self._cupboard(name)
        for name in [("left", "right", "front", "back")[k] for k in rng.permutation(4)]:
            self._painting(name)
        for _ in range(2 if desks < 2 else 1):
            self._bin()
        self._floor_lamp()
        self._visitor_chair()
        self._ceiling_lamps()
        if rng.random() < 0.85:
            self._person()

    def _keep_ways_clear(self) -> None:
        room = self.room
        middle = room.door_x + DOOR_WIDTH / 2
        reach = room.depth * 0.5
        way = self.into.clear
        way.append(world_rect(self.inside, (middle - 0.45, middle + 0.45), (0.0, reach + 0.4)))
        x = sorted((middle, room.width / 2))
        way.append(world_rect(self.inside, (x[0] - 0.4, x[1] + 0.4), (reach - 0.5, reach + 0.5)))
        hinge = (room.door_x - 0.2, room.door_x + 0.4) if room.hinge_left else (
            room.door_x + DOOR_WIDTH - 0.4, room.door_x + DOOR_WIDTH + 0.2)  # fmt: skip
        way.append(world_rect(self.inside, hinge, (0.0, 1.0)))

    def _free(self, name: str, x: tuple[float, float]) -> bool:
        return all(x[1] <= a or x[0] >= b for a, b in self.used[name])

    def _look(self, label: Label, frame: Builder, point: tuple[float, float, float]) -> None:
        self.into.targets.append(Target(label, as_point(frame.world(point)), self.room.index))

    def _workplace(self, name: str) -> bool:
        """A desk against the wall `name` with computer, lamp and chair; below windows it may stand too."""
        rng, (frame, length) = self.rng, self.walls[name]
        width, depth = float(rng.uniform(1.4, 1.75)), float(rng.uniform(0.7, 0.8))
        for _ in range(12):
            x = float(rng.uniform(0.05, max(0.06, length - width - 0.05)))
            if self.into.claim(frame, (x, x + width), (-depth, -0.02)):
                break
        else:
            return False
        furniture.desk(frame.at(x, -0.02), self.palette, rng, width, depth)
        self.used[name].append((x, x + width)) if rng.random() < 0.3 else None
        self._look(Label.DESK, frame, (x + width / 2, -depth / 2, 0.7))
        self._computer(frame, x, width, depth)
        self._chair(frame.at(x + width / 2 + float(rng.uniform(-0.12, 0.12)), -depth))
        return True

    def _computer(self, frame: Builder, x: float, width: float, depth: float) -> None:
        rng, top = self.rng, furniture.DESK_HEIGHT
        centre = x + width * float(rng.uniform(0.42, 0.58))
        turn = float(rng.uniform(-0.25, 0.25))
        furniture.monitor(frame.at(centre, -0.28, top, turn), self.palette, rng)
        self._look(Label.PC, frame, (centre, -0.28, top + 0.25))
        furniture.keyboard(frame.at(centre, -depth + 0.16, top, turn / 2), self.palette)
        side = 1 if rng.random() < 0.5 else -1
        lamp_x = x + width - 0.17 if side > 0 else x + 0.17
        light = furniture.desk_lamp(frame.at(lamp_x, -0.2, top, side * -0.5), self.palette)
        spot = frame.at(lamp_x, -0.2, top, side * -0.5).world(light)
        self.into.lights.append(Light(as_point(spot), (0.05, 0.05, 0.02), (0.30, 0.27, 0.20)))
        self._look(Label.LAMP, frame, (lamp_x, -0.2, top + 0.35))
        tower_x = x + 0.04 if side > 0 else x + width - 0.24
        on_desk = rng.random() < 0.6
        place = frame.at(tower_x, -0.12, top) if on_desk else frame.at(tower_x, -0.12, 0.02)
        furniture.tower(place, self.palette, rng)

    def _chair(self, frame: Builder) -> None:
        rng = self.rng
        for distance in (0.55, 0.45, 0.35):
            if self.into.claim(frame, (-0.3, 0.3), (-distance - 0.3, -distance + 0.3), -0.05) or distance == 0.35:
                yaw = np.pi + float(rng.uniform(-0.7, 0.7))
                furniture.office_chair(frame.at(0, -distance, 0, yaw), self.palette, rng)
                self._look(Label.CHAIR, frame, (0, -distance, 0.6))
                return

    def _cupboard(self, name: str) -> None:
        rng, (frame, length) = self.rng, self.walls[name]
        width, depth = float(rng.uniform(0.8, 1.2)), float(rng.uniform(0.38, 0.45))
        height = float(rng.choice([1.15, 1.75, 2.0]))
        for _ in range(20):
            x = float(rng.uniform(0.03, length - width - 0.03))
            if self._free(name, (x, x + width)) and self.into.claim(frame, (x, x + width), (-depth, 0)):
                furniture.cupboard(frame.at(x, -0.005), self.palette, rng, width, height, depth)
                self.used[name].append((x, x + width))
                self._look(Label.CUPBOARD, frame, (x + width / 2, -depth, 0.7 * height))
                return

    def _painting(self, name: str) -> None:
        rng, (frame, length) = self.rng, self.walls[name]
        width, height = float(rng.uniform(0.65, 1.15)), float(rng.uniform(0.55, 0.85))
        for _ in range(20):
            x = float(rng.uniform(0.15, length - width - 0.15))
            if self._free(name, (x - 0.08, x + width + 0.08)):
                z = float(rng.uniform(1.3, 1.45))
                furniture.painting(frame.at(x, 0, z), self.palette, rng, width, height)
                self.used[name].append((x, x + width))
                self._look(Label.PAINTING, frame, (x + width / 2, 0, z + height / 2))
                return

    def _bin(self) -> None:
        rng = self.rng
        radius, height = float(rng.uniform(0.15, 0.20)), float(rng.uniform(0.34, 0.5))
        for _ in range(40):
            name = str(rng.choice(["left", "right", "front", "back"]))
            frame, length = self.walls[name]
            x = float(rng.uniform(0.25, length - 0.25))
            y = -radius - 0.06
            if self.into.claim(frame, (x - radius, x + radius), (y - radius, y + radius), 0.01):
                furniture.bin_(frame.at(x, y), self.palette, rng, radius, height)
                self._look(Label.RUBBISH_BIN, frame, (x, y, height / 2))
                return

    def _floor_lamp(self) -> None:
        for x, y in ((0.3, self.room.depth - 0.3), (self.room.width - 0.3, self.room.depth - 0.3), (0.3, 0.3),
                     (self.room.width - 0.3, 0.3)):  # fmt: skip
            if self.into.claim(self.inside, (x - 0.2, x + 0.2), (y - 0.2, y + 0.2), 0.0):
                frame = self.inside.at(x, y)
                light = furniture.floor_lamp(frame, self.palette)
                self.into.lights.append(Light(as_point(frame.world(light)), (0.1, 0.1, 0.02), (0.42, 0.36, 0.26)))
                self._look(Label.LAMP, frame, (0, 0, 1.4))
                return

    def _visitor_chair(self) -> None:
        rng = self.rng
        for _ in range(30):
            x = float(rng.uniform(0.4, self.room.width - 0.4))
            y = float(rng.uniform(0.6, self.room.depth - 0.4))
            if self.into.claim(self.inside, (x - 0.28, x + 0.28), (y - 0.28, y + 0.28)):
                frame = self.inside.at(x, y, 0, float(rng.uniform(0, 2 * np.pi)))
                furniture.visitor_chair(frame, self.palette, rng)
                self._look(Label.CHAIR, frame, (0, 0, 0.5))
                return

    def _ceiling_lamps(self) -> None:
        room, rng = self.room, self.rng
        hang = rng.random() < 0.6
        drop = float(rng.uniform(0.45, 0.7))
        for y in (0.3, 0.72):
            frame = self.inside.at(room.width / 2, room.depth * y)
            if hang:
                light = furniture.pendant(frame, self.palette, CEILING, drop)
            else:
                light = furniture.tube_light(frame, self.palette, CEILING, 1.3)
            size = (0.2, 0.2, 0.05) if hang else (0.6, 0.1, 0.02)
            self.into.lights.append(Light(as_point(frame.world(light)), size, (2.1, 2.0, 1.8)))
            self._look(Label.LAMP, frame, light)

    def _person(self) -> None:
        rng = self.rng
        for _ in range(40):
            x = float(rng.uniform(0.5, self.room.width - 0.5))
            y = float(rng.uniform(1.0, self.room.depth - 0.5))
            if self.into.claim(self.inside, (x - 0.25, x + 0.25), (y - 0.25, y + 0.25)):
                px, py = self.room.to_world(x, y)
                self.into.standing.append((px, py, float(rng.uniform(0, 2 * np.pi))))
                self._look(Label.PERSON, self.inside, (x, y, 1.1))
                return


def furnish_corridor(world: Builder, plan: FloorPlan, palette: Palette, rng: Rng, into: Furnishing) -> None:
    """Paintings, bins, one low cupboard and luminaires along the corridor; doors stay free."""
    frames = wall_frames(world, plan.length, plan.width)
    taken: dict[str, list[tuple[float, float]]] = {"back": [], "front": []}
    for room in plan.rooms:
        a, b = (room.to_world(room.door_x + d, 0)[0] for d in (0.0, DOOR_WIDTH))
        a, b = (min(a, b), max(a, b)) if room.yaw == 0 else (plan.length - max(a, b), plan.length - min(a, b))
        taken["back" if room.yaw == 0 else "front"].append((a - 0.2, b + 0.2))
    for kind in ("cupboard", "bin", "painting", "bin", "painting", "painting", "painting"):
        for _ in range(30):
            name = "back" if rng.random() < 0.5 else "front"
            width = {"cupboard": 1.0, "bin": 0.45, "painting": float(rng.uniform(0.8, 1.2))}[kind]
            x = float(rng.uniform(0.3, plan.length - width - 0.3))
            if all(x + width <= a or x >= b for a, b in taken[name]):
                taken[name].append((x, x + width))
                _corridor_piece(kind, frames[name][0].at(x, 0), palette, rng, into, width)
                break
    for k in range(3):
        frame = world.at(plan.length * (k + 0.5) / 3, plan.width / 2)
        light = furniture.tube_light(frame, palette, CEILING, 1.2)
        into.lights.append(Light(as_point(frame.world(light)), (0.55, 0.1, 0.02), (1.7, 1.65, 1.5)))
        into.targets.append(Target(Label.LAMP, as_point(frame.world(light)), None))


def _corridor_piece(kind: str, frame: Builder, palette: Palette, rng: Rng, into: Furnishing, width: float) -> None:
    if kind == "painting":
        height = float(rng.uniform(0.6, 0.85))
        furniture.painting(frame.at(0, 0, 1.3), palette, rng, width, height)
        label, point = Label.PAINTING, (width / 2, 0.0, 1.3 + height / 2)
    elif kind == "bin":
        furniture.bin_(frame.at(0.22, -0.24), palette, rng, 0.2, 0.6)
        into.obstacles.append(world_rect(frame, (0.02, 0.42), (-0.44, 0)))
        label, point = Label.RUBBISH_BIN, (0.22, -0.24, 0.3)
    else:
        furniture.cupboard(frame.at(0, -0.005), palette, rng, width, 1.1, 0.38)
        into.obstacles.append(world_rect(frame, (0, width), (-0.38, 0)))
        label, point = Label.CUPBOARD, (width / 2, -0.2, 0.6)
    into.targets.append(Target(label, as_point(frame.world(point)), None))
