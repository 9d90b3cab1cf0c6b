"""Walls, floors, ceilings, doors and windows of a floor plan, as surfaces."""

import numpy as np

from stsem.synth.bodies import box, tube
from stsem.synth.floorplan import CEILING, DOOR_HEIGHT, DOOR_WIDTH, WALL_THICKNESS, FloorPlan, Opening, Room
from stsem.synth.mesh import Builder
from stsem.synth.palette import Palette
from stsem.synth.vocabulary import Label


def room_frame(world: Builder, room: Room) -> Builder:
    """The builder of the room's local frame."""
    return world.at(room.origin[0], room.origin[1], 0.0, room.yaw)


def wall_frames(inside: Builder, width: float, depth: float) -> dict[str, tuple[Builder, float]]:
    """Per wall its frame (plane y = 0, the room towards -y, x to the right seen from inside) and its length."""
    return {
        "back": (inside.at(0, depth, 0, 0.0), width),
        "front": (inside.at(width, 0, 0, np.pi), width),
        "left": (inside.at(0, 0, 0, np.pi / 2), depth),
        "right": (inside.at(width, depth, 0, -np.pi / 2), depth),
    }


def wall(into: Builder, length: float, openings: tuple[Opening, ...], material: int) -> None:
    """A wall on y = 0 facing -y with rectangular openings, from floor to ceiling."""
    x = 0.0
    for x0, x1, z0, z1 in sorted(openings):
        _panel(into, x, x0, 0.0, CEILING, material)
        _panel(into, x0, x1, 0.0, z0, material)
        _panel(into, x0, x1, z1, CEILING, material)
        x = x1
    _panel(into, x, length, 0.0, CEILING, material)


def _panel(into: Builder, x0: float, x1: float, z0: float, z1: float, material: int) -> None:
    if x1 - x0 < 1e-6 or z1 - z0 < 1e-6:
        return
    corners = [(x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)]
    into.quad(corners, material, Label.WALL, shift=(x0, CEILING - z1))


def slab(into: Builder, x: tuple[float, float], y: tuple[float, float], floor: int, ceiling: int) -> None:
    """Floor and ceiling over a rectangle."""
    (x0, x1), (y0, y1) = x, y
    into.quad([(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)], floor, Label.FLOOR)
    h = CEILING
    into.quad([(x0, y1, h), (x1, y1, h), (x1, y0, h), (x0, y0, h)], ceiling, Label.CEILING)


def room_shell(world: Builder, room: Room, palette: Palette, wall_material: int, floor: int) -> None:
    """Floor, ceiling, four walls, the door and the windows of one room."""
    inside = room_frame(world, room)
    slab(inside, (0, room.width), (0, room.depth), floor, palette.ceiling)
    frames = wall_frames(inside, room.width, room.depth)
    left = room.width - room.door_x - DOOR_WIDTH
    doorway: Opening = (left, left + DOOR_WIDTH, 0.0, DOOR_HEIGHT)
    openings: dict[str, tuple[Opening, ...]] = {"back": room.windows, "front": (doorway,)}
    for name, (frame, length) in frames.items():
        wall(frame, length, openings.get(name, ()), wall_material)
    for k, opening in enumerate(room.windows):
        window(frames["back"][0], opening, palette, palette.views[(room.index + k) % len(palette.views)])
    door(inside.at(room.door_x, 0), palette, room.hinge_left, room.angle, WALL_THICKNESS)


def door(into: Builder, palette: Palette, hinge_left: bool, angle: float, thickness: float) -> None:
    """Frame and leaf of a door; the opening is x in [0, DOOR_WIDTH], y in [-thickness, 0]; opens towards +y."""
    w, h, rim = DOOR_WIDTH, DOOR_HEIGHT, 0.07
    y = (-thickness - 0.012, 0.012)
    box(into, (-rim, 0.03), y, (0, h + rim), palette.door_frame, Label.DOOR, bottom=False)
    box(into, (w - 0.03, w + rim), y, (0, h + rim), palette.door_frame, Label.DOOR, bottom=False)
    box(into, (0.03, w - 0.03), y, (h - 0.03, h + rim), palette.door_frame, Label.DOOR)
    into.quad(
        [(0, -thickness, 0.001), (w, -thickness, 0.001), (w, 0, 0.001), (0, 0, 0.001)], palette.door_frame, Label.DOOR
    )
    hinge = into.at(0.035 if hinge_left else w - 0.035, -0.01, 0, angle if hinge_left else -angle)
    span = (0.0, w - 0.07) if hinge_left else (-(w - 0.07), 0.0)
    leaf(hinge, palette, span)


def leaf(into: Builder, palette: Palette, span: tuple[float, float]) -> None:
    """A door leaf over x in `span`, 4 cm thick below y = 0, with handles on both sides."""
    x0, x1 = span
    z0, z1 = 0.008, DOOR_HEIGHT - 0.032
    box(into, span, (-0.04, 0.0), (z0, z1), palette.door, Label.DOOR, front=palette.door)
    into.quad([(x1, 0.001, z0), (x0, 0.001, z0), (x0, 0.001, z1), (x1, 0.001, z1)], palette.door, Label.DOOR, fit=True)
    knob = x1 - 0.07 if x0 == 0.0 else x0 + 0.07
    grip = knob - 0.11 if x0 == 0.0 else knob + 0.11
    for y in (-0.09, 0.05):
        tube(into, (knob, -0.02, 1.03), (knob, y, 1.03), (0.012, 0.012), palette.lamp_body, Label.DOOR, sides=6)
        tube(into, (knob, y, 1.03), (grip, y, 1.03), (0.012, 0.012), palette.lamp_body, Label.DOOR, sides=6)


def window(into: Builder, opening: Opening, palette: Palette, view: int) -> None:
    """A window in the wall plane y = 0 facing -y: pane behind the wall, reveal, sash, sill."""
    x0, x1, z0, z1 = opening
    back, material = 0.14, palette.window_frame
    into.quad([(x0, back, z0), (x1, back, z0), (x1, back, z1), (x0, back, z1)], view, Label.WINDOWS, fit=True)
    into.quad([(x0, 0, z0), (x1, 0, z0), (x1, back, z0), (x0, back, z0)], material, Label.WINDOWS)
    into.quad([(x0, back, z1), (x1, back, z1), (x1, 0, z1), (x0, 0, z1)], material, Label.WINDOWS)
    into.quad([(x0, 0, z0), (x0, back, z0), (x0, back, z1), (x0, 0, z1)], material, Label.WINDOWS)
    into.quad([(x1, back, z0), (x1, 0, z0), (x1, 0, z1), (x1, back, z1)], material, Label.WINDOWS)
    rim, y = 0.06, (back - 0.06, back - 0.005)
    bars = max(2, round((x1 - x0) / 0.8) + 1)
    for k in range(bars):
        x = x0 + (x1 - x0 - rim) * k / (bars - 1)
        box(into, (x, x + rim), y, (z0, z1), material, Label.WINDOWS)
    for z in (z0, z1 - rim):
        box(into, (x0, x1), y, (z, z + rim), material, Label.WINDOWS)
    box(into, (x0 - 0.05, x1 + 0.05), (-0.10, 0.0), (z0 - 0.035, z0), material, Label.WINDOWS)


def corridor_shell(world: Builder, plan: FloorPlan, palette: Palette) -> None:
    """Floor, ceiling and walls of the corridor, with a closed door at either end."""
    slab(world, (0, plan.length), (0, plan.width), palette.corridor_floor, palette.ceiling)
    frames = wall_frames(world, plan.length, plan.width)
    north, south = _doorways(plan, 0), _doorways(plan, 1)
    wall(frames["back"][0], plan.length, north, palette.corridor_wall)
    mirrored = tuple((plan.length - x1, plan.length - x0, z0, z1) for x0, x1, z0, z1 in south)
    wall(frames["front"][0], plan.length, mirrored, palette.corridor_wall)
    x0 = (plan.width - DOOR_WIDTH) / 2
    for name in ("left", "right"):
        frame = frames[name][0]
        wall(frame, plan.width, ((x0, x0 + DOOR_WIDTH, 0.0, DOOR_HEIGHT),), palette.corridor_wall)
        door(frame.at(x0 + DOOR_WIDTH, 0.0, 0, np.pi), palette, True, 0.0, 0.06)


def _doorways(plan: FloorPlan, side: int) -> tuple[Opening, ...]:
    """Door openings of one side in world x."""
    found = []
    for room in plan.rooms[2 * side : 2 * side + 2]:
        a, b = room.to_world(room.door_x, 0)[0], room.to_world(room.door_x + DOOR_WIDTH, 0)[0]
        found.append((min(a, b), max(a, b), 0.0, DOOR_HEIGHT))
    return tuple(found)
