"""Which colours and surfaces an office wears: everything about its look that a layout draws."""

from dataclasses import dataclass

import numpy as np

from stsem.chance import generator
from stsem.synth import patterns, pictures
from stsem.synth.materials import MaterialTable
from stsem.synth.patterns import Rgb, Rng

_WALLS: tuple[Rgb, ...] = (
    (0.90, 0.88, 0.82), (0.85, 0.87, 0.88), (0.88, 0.84, 0.72), (0.78, 0.84, 0.80), (0.80, 0.82, 0.90),
    (0.92, 0.91, 0.89), (0.87, 0.78, 0.72),
)  # fmt: skip
_CARPETS: tuple[tuple[Rgb, Rgb], ...] = (
    ((0.33, 0.36, 0.42), (0.60, 0.64, 0.70)), ((0.42, 0.33, 0.30), (0.66, 0.55, 0.45)),
    ((0.30, 0.38, 0.33), (0.56, 0.64, 0.50)), ((0.24, 0.29, 0.42), (0.50, 0.55, 0.72)),
    ((0.46, 0.44, 0.42), (0.25, 0.24, 0.24)), ((0.45, 0.25, 0.26), (0.70, 0.50, 0.45)),
)  # fmt: skip
_PLANKS: tuple[Rgb, ...] = ((0.66, 0.48, 0.30), (0.55, 0.38, 0.24), (0.74, 0.60, 0.43), (0.50, 0.42, 0.36))
_TILES: tuple[Rgb, ...] = ((0.62, 0.60, 0.56), (0.52, 0.53, 0.55), (0.66, 0.58, 0.48))
_WOODS: tuple[Rgb, ...] = (
    (0.80, 0.62, 0.40),
    (0.62, 0.42, 0.25),
    (0.45, 0.28, 0.17),
    (0.86, 0.76, 0.60),
    (0.83, 0.83, 0.82),
)
_DOORS: tuple[Rgb, ...] = (
    (0.58, 0.36, 0.20),
    (0.70, 0.50, 0.30),
    (0.42, 0.25, 0.15),
    (0.30, 0.42, 0.55),
    (0.50, 0.30, 0.26),
)
_CUPBOARDS: tuple[Rgb, ...] = (
    (0.72, 0.60, 0.44),
    (0.60, 0.62, 0.65),
    (0.86, 0.85, 0.80),
    (0.50, 0.36, 0.25),
    (0.48, 0.56, 0.60),
)
_CLOTH: tuple[Rgb, ...] = (
    (0.12, 0.16, 0.32), (0.45, 0.10, 0.12), (0.12, 0.30, 0.22), (0.10, 0.10, 0.11), (0.22, 0.34, 0.55),
    (0.62, 0.36, 0.12), (0.36, 0.16, 0.40),
)  # fmt: skip
_SHIRTS: tuple[Rgb, ...] = (
    (0.80, 0.16, 0.18), (0.16, 0.32, 0.72), (0.88, 0.86, 0.84), (0.92, 0.66, 0.14), (0.20, 0.55, 0.30),
    (0.55, 0.22, 0.58), (0.30, 0.62, 0.70), (0.88, 0.48, 0.50),
)  # fmt: skip
_TROUSERS: tuple[Rgb, ...] = (
    (0.14, 0.18, 0.30),
    (0.10, 0.10, 0.12),
    (0.40, 0.34, 0.26),
    (0.26, 0.27, 0.30),
    (0.24, 0.32, 0.48),
)
_SKINS: tuple[Rgb, ...] = ((0.90, 0.71, 0.60), (0.78, 0.56, 0.43), (0.56, 0.38, 0.28), (0.40, 0.27, 0.20))
_HAIRS: tuple[Rgb, ...] = (
    (0.10, 0.08, 0.07),
    (0.34, 0.22, 0.13),
    (0.66, 0.50, 0.28),
    (0.55, 0.54, 0.53),
    (0.42, 0.18, 0.10),
)
_BINS: tuple[Rgb, ...] = (
    (0.10, 0.30, 0.16),
    (0.08, 0.16, 0.38),
    (0.14, 0.14, 0.15),
    (0.55, 0.10, 0.10),
    (0.50, 0.51, 0.53),
)


def pick(rng: Rng, options: tuple[Rgb, ...], spread: float = 0.05) -> Rgb:
    """One of `options`, its channels shifted a little."""
    r, g, b = (
        float(np.clip(c + rng.uniform(-spread, spread), 0.03, 0.97)) for c in options[int(rng.integers(len(options)))]
    )
    return r, g, b


@dataclass(frozen=True)
class Palette:
    """Material indices of one office; tuples hold alternatives for furniture to draw from."""

    walls: tuple[int, ...]
    corridor_wall: int
    floors: tuple[int, ...]
    corridor_floor: int
    ceiling: int
    desk: int
    desk_tops: tuple[int, ...]
    cloths: tuple[int, ...]
    chair_frame: int
    pc_body: int
    towers: tuple[int, ...]
    screens: tuple[int, ...]
    keyboard: int
    door: int
    door_frame: int
    window_frame: int
    views: tuple[int, ...]
    paintings: tuple[int, ...]
    picture_frames: tuple[int, ...]
    cupboards: tuple[int, ...]
    cupboard_fronts: tuple[tuple[int, int], ...]
    bins: tuple[int, ...]
    lamp_body: int
    lamp_glow: int
    lamp_shade: int


def furnish_palette(table: MaterialTable, layout: int) -> Palette:
    """Draw the look of `layout` and add its surfaces to `table`."""
    rng = generator(layout, "palette")
    dark_pc = bool(rng.random() < 0.7)
    pc: Rgb = (0.11, 0.11, 0.12) if dark_pc else (0.78, 0.77, 0.72)
    wood, frame = pick(rng, _WOODS), pick(rng, _DOORS)
    daylight = float(rng.uniform(0.8, 1.0))
    bodies = [pick(rng, _CUPBOARDS) for _ in range(2)]
    cupboards = tuple(table.tiled(patterns.wood(rng, c, 256), 1.2) for c in bodies)
    return Palette(
        walls=tuple(table.tiled(patterns.paint(rng, pick(rng, _WALLS, 0.03)), 2.2) for _ in range(2)),
        corridor_wall=table.tiled(patterns.paint(rng, pick(rng, _WALLS, 0.03)), 2.2),
        floors=tuple(_floor(rng, table) for _ in range(2)),
        corridor_floor=_floor(rng, table),
        ceiling=_ceiling(rng, table),
        desk=table.tiled(patterns.wood(rng, wood, 256), 1.2),
        desk_tops=tuple(table.fitted(pictures.desk_top(rng, wood)) for _ in range(3)),
        cloths=tuple(table.tiled(patterns.woven(rng, pick(rng, _CLOTH)), 0.5) for _ in range(2)),
        chair_frame=table.tiled(patterns.speckled(rng, (0.13, 0.13, 0.14)), 0.6),
        pc_body=table.tiled(patterns.speckled(rng, pc), 0.6),
        towers=(table.fitted(pictures.tower_front(rng, pc)),),
        screens=tuple(table.fitted(pictures.screen(rng), 0.85) for _ in range(3)),
        keyboard=table.fitted(pictures.keyboard(rng, dark_pc)),
        door=table.fitted(pictures.door_leaf(rng, frame, bool(rng.random() < 0.3))),
        door_frame=table.tiled(patterns.wood(rng, tuple_scaled(frame, 0.72), 128), 0.8),
        window_frame=table.tiled(
            patterns.speckled(rng, pick(rng, ((0.92, 0.92, 0.91), (0.55, 0.56, 0.58)), 0.02)), 0.8
        ),
        views=tuple(table.fitted(pictures.outside(rng, daylight), 1.5) for _ in range(3)),
        paintings=tuple(table.fitted(pictures.painting(rng)) for _ in range(7)),
        picture_frames=tuple(
            table.tiled(patterns.wood(rng, c, 128), 0.6)
            for c in ((0.12, 0.10, 0.09), (0.70, 0.55, 0.25), (0.45, 0.28, 0.16))
        ),
        cupboards=cupboards,
        cupboard_fronts=tuple(_fronts(rng, table, c) for c in bodies),
        bins=tuple(table.tiled(patterns.speckled(rng, pick(rng, _BINS, 0.04), 0.07), 0.6) for _ in range(2)),
        lamp_body=table.tiled(patterns.speckled(rng, pick(rng, ((0.75, 0.75, 0.74), (0.16, 0.16, 0.17)), 0.03)), 0.6),
        lamp_glow=table.tiled(patterns.speckled(rng, (1.0, 0.97, 0.88), 0.015), 0.6, 2.6),
        lamp_shade=table.tiled(
            patterns.speckled(rng, pick(rng, ((0.95, 0.85, 0.62), (0.92, 0.70, 0.40)), 0.03), 0.03), 0.6, 1.0
        ),
    )  # fmt: skip


def clothing(table: MaterialTable, rng: Rng) -> dict[str, int]:
    """Materials of one person: shirt, trousers, skin, hair, shoes."""
    shirt = pick(rng, _SHIRTS)
    cloth = patterns.striped(rng, shirt, pick(rng, _SHIRTS)) if rng.random() < 0.3 else patterns.woven(rng, shirt)
    return {
        "shirt": table.tiled(cloth, 0.9),
        "trousers": table.tiled(patterns.woven(rng, pick(rng, _TROUSERS)), 0.7),
        "skin": table.tiled(patterns.speckled(rng, pick(rng, _SKINS, 0.02)), 0.8),
        "hair": table.tiled(patterns.woven(rng, pick(rng, _HAIRS, 0.03)), 0.3),
        "shoes": table.tiled(patterns.speckled(rng, (0.10, 0.08, 0.07)), 0.5),
    }


def tuple_scaled(colour: Rgb, factor: float) -> Rgb:
    """`colour` made darker or lighter."""
    r, g, b = (min(1.0, c * factor) for c in colour)
    return r, g, b


def _floor(rng: Rng, table: MaterialTable) -> int:
    kind = int(rng.integers(4))
    base, fleck = _CARPETS[int(rng.integers(len(_CARPETS)))]
    if kind == 0:
        return table.tiled(patterns.carpet(rng, base, fleck), 1.6)
    if kind == 1:
        return table.tiled(patterns.carpet_tiles(rng, base, fleck), 2.0)
    if kind == 2:
        return table.tiled(patterns.planks(rng, pick(rng, _PLANKS)), 2.0)
    return table.tiled(patterns.floor_tiles(rng, pick(rng, _TILES), (0.36, 0.35, 0.34)), 2.0)


def _ceiling(rng: Rng, table: MaterialTable) -> int:
    base = pick(rng, ((0.93, 0.93, 0.92), (0.90, 0.89, 0.86)), 0.02)
    if rng.random() < 0.75:
        return table.tiled(patterns.ceiling_tiles(rng, base), 1.25)
    return table.tiled(patterns.plaster(rng, base), 1.8)


def _fronts(rng: Rng, table: MaterialTable, base: Rgb) -> tuple[int, int]:
    closed = table.fitted(pictures.cupboard_front(rng, base, 2))
    return closed, table.fitted(pictures.shelves(rng, base, int(rng.integers(4, 6))))
