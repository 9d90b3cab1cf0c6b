"""A person of ellipsoids and limbs, standing or in mid-stride."""

from dataclasses import dataclass

import numpy as np

from stsem.synth.bodies import ellipsoid, tube
from stsem.synth.mesh import Builder
from stsem.synth.vocabulary import Label


@dataclass(frozen=True)
class Outfit:
    """What a person looks like: height in metres, materials of shirt, trousers, skin, hair and shoes."""

    height: float
    shirt: int
    trousers: int
    skin: int
    hair: int
    shoes: int


def person(into: Builder, outfit: Outfit, stride: float) -> None:
    """A person at the origin looking along +x; `stride` in -1..1 swings legs and arms (0 stands)."""
    s, label = outfit.height / 1.75, Label.PERSON
    for side in (-1, 1):
        _leg(into, outfit, side, side * stride, s)
        _arm(into, outfit, side, -side * stride, s)
    ellipsoid(into, (0, 0, 0.95 * s), (0.14 * s, 0.19 * s, 0.14 * s), outfit.trousers, label)
    tube(into, (0, 0, 0.93 * s), (0, 0, 1.34 * s), (0.165 * s, 0.205 * s), outfit.shirt, label, sides=12, flat=0.66)
    ellipsoid(into, (0, 0, 1.34 * s), (0.14 * s, 0.225 * s, 0.13 * s), outfit.shirt, label)
    tube(into, (0, 0, 1.42 * s), (0.01, 0, 1.54 * s), (0.055 * s, 0.052 * s), outfit.skin, label, sides=8, caps=False)
    ellipsoid(into, (0.02 * s, 0, 1.62 * s), (0.10 * s, 0.078 * s, 0.125 * s), outfit.skin, label, sides=12, rings=8)
    ellipsoid(into, (-0.012 * s, 0, 1.655 * s), (0.105 * s, 0.088 * s, 0.105 * s), outfit.hair, label, sides=12)
    ellipsoid(into, (0.115 * s, 0, 1.61 * s), (0.02 * s, 0.014 * s, 0.02 * s), outfit.skin, label, sides=6, rings=4)


def _leg(into: Builder, outfit: Outfit, side: int, swing: float, s: float) -> None:
    angle = 0.45 * swing
    hip = np.array([0.0, side * 0.09, 0.92]) * s
    knee = hip + 0.44 * s * np.array([np.sin(angle), 0, -np.cos(angle)])
    bend = angle - 0.5 * max(0.0, -swing)
    ankle = knee + 0.42 * s * np.array([np.sin(bend), 0, -np.cos(bend)])
    tube(into, hip, knee, (0.088 * s, 0.062 * s), outfit.trousers, Label.PERSON, sides=10)
    tube(into, knee, ankle, (0.064 * s, 0.048 * s), outfit.trousers, Label.PERSON, sides=10)
    ellipsoid(
        into,
        ankle + np.array([0.055, 0, -0.01]) * s,
        (0.13 * s, 0.05 * s, 0.05 * s),
        outfit.shoes,
        Label.PERSON,
        sides=8,
    )


def _arm(into: Builder, outfit: Outfit, side: int, swing: float, s: float) -> None:
    angle = 0.5 * swing
    shoulder = np.array([0.0, side * 0.225, 1.37]) * s
    elbow = shoulder + 0.29 * s * np.array([np.sin(angle), side * 0.12, -np.cos(angle)])
    wrist = elbow + 0.26 * s * np.array([np.sin(angle + 0.35), 0, -np.cos(angle + 0.35)])
    tube(into, shoulder, elbow, (0.062 * s, 0.05 * s), outfit.shirt, Label.PERSON, sides=8)
    tube(into, elbow, wrist, (0.048 * s, 0.035 * s), outfit.shirt, Label.PERSON, sides=8)
    ellipsoid(into, wrist, (0.04 * s, 0.035 * s, 0.06 * s), outfit.skin, Label.PERSON, sides=8, rings=4)
