"""Pieces of furniture, each in its own frame: it stands on z = 0 with its back at y = 0 and its front towards -y."""

import numpy as np

from stsem.synth.bodies import box, ellipsoid, tube
from stsem.synth.mesh import Builder
from stsem.synth.palette import Palette
from stsem.synth.patterns import Rng
from stsem.synth.vocabulary import Label

DESK_HEIGHT = 0.74


def one_of(rng: Rng, options: tuple[int, ...]) -> int:
    """One of several materials."""
    return options[int(rng.integers(len(options)))]


def desk(into: Builder, palette: Palette, rng: Rng, width: float, depth: float) -> None:
    """Top, legs, a modesty panel and a drawer unit; x in [0, width], y in [-depth, 0]."""
    top = one_of(rng, palette.desk_tops)
    box(into, (0, width), (-depth, 0), (DESK_HEIGHT - 0.03, DESK_HEIGHT), palette.desk, Label.DESK, top=top)
    for x in (0.03, width - 0.09):
        for y in (-depth + 0.04, -0.10):
            box(into, (x, x + 0.06), (y, y + 0.06), (0, DESK_HEIGHT - 0.03), palette.desk, Label.DESK, bottom=False)
    box(into, (0.09, width - 0.09), (-0.10, -0.08), (0.25, DESK_HEIGHT - 0.03), palette.desk, Label.DESK)
    x = 0.12 if rng.random() < 0.5 else width - 0.54
    for k in range(3):
        z = 0.06 + k * 0.2
        box(into, (x, x + 0.42), (-depth + 0.06, -0.12), (z, z + 0.185), palette.desk, Label.DESK)


def monitor(into: Builder, palette: Palette, rng: Rng) -> None:
    """Screen on a foot, centred on x = 0, about 0.2 m deep around y = 0; looks towards -y."""
    half, high = rng.uniform(0.26, 0.33), rng.uniform(0.33, 0.40)
    face, body = one_of(rng, palette.screens), palette.pc_body
    box(into, (-half, half), (0.0, 0.045), (0.10, 0.10 + high), body, Label.PC)
    into.quad(
        [(-half + 0.015, -0.003, 0.125), (half - 0.015, -0.003, 0.125), (half - 0.015, -0.003, 0.085 + high),
         (-half + 0.015, -0.003, 0.085 + high)], face, Label.PC, fit=True,
    )  # fmt: skip
    box(into, (-0.035, 0.035), (0.045, 0.075), (0.01, 0.3), body, Label.PC)
    box(into, (-0.13, 0.13), (-0.08, 0.11), (0.0, 0.014), body, Label.PC)


def keyboard(into: Builder, palette: Palette) -> None:
    """Keyboard and mouse around the origin."""
    box(into, (-0.23, 0.23), (-0.08, 0.08), (0, 0.022), palette.pc_body, Label.PC, top=palette.keyboard)
    ellipsoid(
        into, (0.33, 0.0, 0.005), (0.035, 0.055, 0.03), palette.pc_body, Label.PC, sides=8, rings=3, span=(0, 0.5)
    )


def tower(into: Builder, palette: Palette, rng: Rng) -> None:
    """The computer itself: x in [0, 0.2], y in [-0.45, 0]."""
    front = one_of(rng, palette.towers)
    box(into, (0, 0.20), (-0.45, 0), (0.0, 0.44), palette.pc_body, Label.PC, front=front)


def office_chair(into: Builder, palette: Palette, rng: Rng) -> None:
    """A swivel chair around the origin; whoever sits on it looks towards -y."""
    cloth, frame = one_of(rng, palette.cloths), palette.chair_frame
    for k in range(5):
        angle = 2 * np.pi * k / 5
        foot = (0.30 * np.cos(angle), 0.30 * np.sin(angle), 0.06)
        tube(into, (0, 0, 0.10), foot, (0.028, 0.020), frame, Label.CHAIR, sides=6)
        ellipsoid(into, (foot[0], foot[1], 0.035), (0.035, 0.035, 0.035), frame, Label.CHAIR, sides=6, rings=4)
    tube(into, (0, 0, 0.08), (0, 0, 0.44), (0.03, 0.03), frame, Label.CHAIR, sides=8, caps=False)
    box(into, (-0.24, 0.24), (-0.24, 0.23), (0.43, 0.52), cloth, Label.CHAIR)
    box(into, (-0.04, 0.04), (0.24, 0.28), (0.45, 0.70), frame, Label.CHAIR)
    box(into, (-0.22, 0.22), (0.22, 0.29), (0.60, 1.04), cloth, Label.CHAIR)
    if rng.random() < 0.6:
        for x in (-0.29, 0.25):
            box(into, (x, x + 0.04), (-0.14, 0.16), (0.66, 0.70), frame, Label.CHAIR)
            box(into, (x, x + 0.04), (0.0, 0.05), (0.47, 0.66), frame, Label.CHAIR)


def visitor_chair(into: Builder, palette: Palette, rng: Rng) -> None:
    """A chair on four legs around the origin, looking towards -y."""
    cloth, frame = one_of(rng, palette.cloths), palette.chair_frame
    for x in (-0.21, 0.21):
        tube(into, (x, -0.2, 0), (x, -0.2, 0.45), (0.016, 0.016), frame, Label.CHAIR, sides=6, caps=False)
        tube(into, (x, 0.22, 0), (x, 0.24, 0.88), (0.016, 0.016), frame, Label.CHAIR, sides=6)
    box(into, (-0.23, 0.23), (-0.23, 0.22), (0.43, 0.48), cloth, Label.CHAIR)
    box(into, (-0.22, 0.22), (0.21, 0.25), (0.56, 0.90), cloth, Label.CHAIR)


def cupboard(into: Builder, palette: Palette, rng: Rng, width: float, height: float, depth: float) -> None:
    """A cupboard with doors or open shelves; x in [0, width], y in [-depth, 0]."""
    kind = int(rng.integers(len(palette.cupboards)))
    front = palette.cupboard_fronts[kind][0 if rng.random() < 0.6 else 1]
    box(
        into, (0, width), (-depth, 0), (0.0, height), palette.cupboards[kind], Label.CUPBOARD, front=front, bottom=False
    )


def bin_(into: Builder, palette: Palette, rng: Rng, radius: float, height: float) -> None:
    """An open tapered rubbish bin around the origin."""
    body = one_of(rng, palette.bins)
    tube(into, (0, 0, 0), (0, 0, height), (0.8 * radius, radius), body, Label.RUBBISH_BIN, sides=14, caps=False)
    inner = (0.8 * radius - 0.01, radius - 0.01)
    tube(into, (0, 0, 0.01), (0, 0, height), inner, body, Label.RUBBISH_BIN, sides=14, caps=False, inside=True)
    tube(into, (0, 0, 0.01), (0, 0, 0.3 * height), (0.78 * radius, 0.8 * radius), body, Label.RUBBISH_BIN, sides=14)
    rim = (radius + 0.012, radius + 0.012)
    tube(into, (0, 0, height - 0.03), (0, 0, height), rim, body, Label.RUBBISH_BIN, sides=14, caps=False)


def painting(into: Builder, palette: Palette, rng: Rng, width: float, height: float) -> None:
    """A framed picture on the plane y = 0, its lower left corner at the origin, facing -y."""
    picture, frame = one_of(rng, palette.paintings), one_of(rng, palette.picture_frames)
    rim = 0.045
    box(into, (0, width), (-0.035, 0), (0, height), frame, Label.PAINTING)
    into.quad(
        [(rim, -0.037, rim), (width - rim, -0.037, rim), (width - rim, -0.037, height - rim),
         (rim, -0.037, height - rim)],
        picture, Label.PAINTING, fit=True,
    )  # fmt: skip


def desk_lamp(into: Builder, palette: Palette) -> tuple[float, float, float]:
    """A jointed lamp standing at the origin, bent towards -y; returns where its light sits."""
    body = palette.lamp_body
    tube(into, (0, 0, 0), (0, 0, 0.025), (0.09, 0.08), body, Label.LAMP, sides=12)
    tube(into, (0, 0, 0.02), (0, 0.08, 0.30), (0.014, 0.014), body, Label.LAMP, sides=6)
    tube(into, (0, 0.08, 0.30), (0, -0.12, 0.47), (0.014, 0.014), body, Label.LAMP, sides=6)
    tube(into, (0, -0.11, 0.50), (0, -0.17, 0.38), (0.04, 0.11), body, Label.LAMP, sides=12, caps=False)
    tube(into, (0, -0.115, 0.485), (0, -0.166, 0.39), (0.035, 0.10), palette.lamp_glow, Label.LAMP, sides=12)
    return 0.0, -0.19, 0.34


def floor_lamp(into: Builder, palette: Palette) -> tuple[float, float, float]:
    """A standing lamp with a cloth shade at the origin; returns where its light sits."""
    tube(into, (0, 0, 0), (0, 0, 0.03), (0.15, 0.14), palette.lamp_body, Label.LAMP, sides=14)
    tube(into, (0, 0, 0.02), (0, 0, 1.36), (0.016, 0.016), palette.lamp_body, Label.LAMP, sides=6)
    tube(into, (0, 0, 1.30), (0, 0, 1.66), (0.23, 0.16), palette.lamp_shade, Label.LAMP, sides=14, caps=False)
    tube(into, (0, 0, 1.32), (0, 0, 1.62), (0.21, 0.15), palette.lamp_glow, Label.LAMP, sides=14)
    return 0.0, 0.0, 1.72


def pendant(into: Builder, palette: Palette, ceiling: float, drop: float) -> tuple[float, float, float]:
    """A round lamp hanging `drop` metres below the ceiling; returns where its light sits."""
    z = ceiling - drop
    tube(into, (0, 0, z + 0.18), (0, 0, ceiling), (0.012, 0.012), palette.lamp_body, Label.LAMP, sides=6, caps=False)
    tube(into, (0, 0, z), (0, 0, z + 0.20), (0.27, 0.09), palette.lamp_body, Label.LAMP, sides=16)
    ellipsoid(into, (0, 0, z), (0.24, 0.24, 0.09), palette.lamp_glow, Label.LAMP, sides=14, rings=4, span=(-0.5, 0.0))
    return 0.0, 0.0, z - 0.12


def tube_light(into: Builder, palette: Palette, ceiling: float, length: float) -> tuple[float, float, float]:
    """A box luminaire under the ceiling, long along x; returns where its light sits."""
    half = length / 2
    box(into, (-half, half), (-0.14, 0.14), (ceiling - 0.05, ceiling - 0.0), palette.lamp_body, Label.LAMP)
    box(
        into,
        (-half + 0.03, half - 0.03),
        (-0.12, 0.12),
        (ceiling - 0.09, ceiling - 0.045),
        palette.lamp_glow,
        Label.LAMP,
    )
    return 0.0, 0.0, ceiling - 0.14
