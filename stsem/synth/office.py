"""One office floor: plan, look, furniture and people of a layout number, ready to be lit and rendered."""

from dataclasses import dataclass

import numpy as np

from stsem.chance import generator
from stsem.synth.building import corridor_shell, room_frame, room_shell
from stsem.synth.floorplan import CEILING, FloorPlan, Room, draw_plan
from stsem.synth.furnish import Furnishing, Light, RoomFurnisher, furnish_corridor
from stsem.synth.materials import Materials, MaterialTable
from stsem.synth.mesh import Builder, Quads
from stsem.synth.palette import clothing, furnish_palette
from stsem.synth.person import Outfit, person
from stsem.synth.vocabulary import Label

_WALKERS = 3


@dataclass(frozen=True)
class Office:
    """A floor that does not move, and the people who may walk through it.

    Args:
        plan: rooms and corridor.
        quads: every static surface.
        materials: what the surfaces look like.
        furnishing: obstacles, targets and lights, in the world frame.
        walkers: outfits of people who walk.
    """

    plan: FloorPlan
    quads: Quads
    materials: Materials
    furnishing: Furnishing
    walkers: tuple[Outfit, ...]


def build_office(layout: int) -> Office:
    """The office of `layout`; equal numbers give equal offices, different ones differ in plan, look and furniture."""
    table = MaterialTable()
    palette = furnish_palette(table, layout)
    plan, world, furnishing = draw_plan(layout), Builder(), Furnishing()
    corridor_shell(world, plan, palette)
    for room in plan.rooms:
        rng = generator(layout, "room", room.index)
        wall, floor = palette.walls[int(rng.integers(2))], palette.floors[int(rng.integers(2))]
        room_shell(world, room, palette, wall, floor)
        RoomFurnisher(room_frame(world, room), room, palette, rng, furnishing).furnish()
        furnishing.lights.extend(_daylight(room))
    furnish_corridor(world, plan, palette, generator(layout, "corridor"), furnishing)
    _void(world, plan, palette.corridor_wall)
    rng = generator(layout, "people")
    for x, y, yaw in furnishing.standing:
        person(world.at(x, y, 0, yaw), draw_outfit(table, rng), float(rng.uniform(-0.25, 0.25)))
    walkers = tuple(draw_outfit(table, rng) for _ in range(_WALKERS))
    return Office(plan, world.build(), table.build(), furnishing, walkers)


def draw_outfit(table: MaterialTable, rng: np.random.Generator) -> Outfit:
    """A person's height and clothes."""
    m = clothing(table, rng)
    height = float(rng.uniform(1.60, 1.88))
    return Outfit(height, m["shirt"], m["trousers"], m["skin"], m["hair"], m["shoes"])


def _daylight(room: Room) -> list[Light]:
    lights = []
    for x0, x1, z0, z1 in room.windows:
        x, y = room.to_world((x0 + x1) / 2, room.depth)
        facing = (0.0, -1.0 if room.yaw == 0 else 1.0, 0.0)
        area = (x1 - x0) * (z1 - z0)
        size = ((x1 - x0) / 2, 0.0, (z1 - z0) / 2)
        lights.append(
            Light((x, y + 0.05 * facing[1], (z0 + z1) / 2), size, (1.25 * area, 1.4 * area, 1.6 * area), facing)
        )
    return lights


def _void(world: Builder, plan: FloorPlan, material: int) -> None:
    """A wall around everything, so that a ray through a crack still meets a labelled surface."""
    x0, x1 = -1.0, plan.length + 1.0
    y0, y1, z0, z1 = -7.0, plan.width + 7.0, -0.5, CEILING + 0.5
    for corners in (
        [(x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)],
        [(x1, y0, z0), (x0, y0, z0), (x0, y0, z1), (x1, y0, z1)],
        [(x0, y0, z0), (x0, y1, z0), (x0, y1, z1), (x0, y0, z1)],
        [(x1, y1, z0), (x1, y0, z0), (x1, y0, z1), (x1, y1, z1)],
        [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)],
        [(x0, y1, z1), (x1, y1, z1), (x1, y0, z1), (x0, y0, z1)],
    ):
        world.quad(corners, material, Label.WALL)
