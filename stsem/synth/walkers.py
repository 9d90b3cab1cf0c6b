"""People who walk up and down the corridor."""

from dataclasses import dataclass

import numpy as np

from stsem.chance import generator
from stsem.synth.lighting import illuminate
from stsem.synth.mesh import Builder
from stsem.synth.office import Office
from stsem.synth.person import Outfit, person
from stsem.synth.tracer import Tracer
from stsem.synth.view import LitBody, lit_body

_END_M = 0.9
_STRIDE_M = 1.3
_LANE = 0.2


@dataclass(frozen=True)
class Walker:
    """One person on a line along the corridor, turning about at its ends.

    Args:
        office: the floor, for its lights and materials.
        tracer: of the static scene: it casts the shadows.
        outfit: how the person looks.
        speed: m/s.
        start: position along the line at time zero, metres.
    """

    office: Office
    tracer: Tracer
    outfit: Outfit
    speed: float
    start: float

    def place(self, time_s: float) -> tuple[float, float, float]:
        """World x, y and yaw at `time_s`."""
        span = self.office.plan.length - 2 * _END_M
        along = (self.start + self.speed * time_s) % (2 * span)
        back = along > span
        x = _END_M + (2 * span - along if back else along)
        return x, self.office.plan.width * _LANE, np.pi if back else 0.0

    def at(self, time_s: float) -> LitBody:
        """The person as a lit body at `time_s`."""
        x, y, yaw = self.place(time_s)
        builder = Builder()
        stride = float(np.sin(2 * np.pi * self.speed * time_s / _STRIDE_M))
        person(builder.at(x, y, 0.0, yaw), self.outfit, stride)
        quads = builder.build()
        light = illuminate(quads, self.tracer, self.office.furnishing.lights)
        return lit_body(quads, Tracer(quads), light, self.office.materials)


def walker(office: Office, tracer: Tracer, seed: int) -> list[Walker]:
    """The walkers of an office: one, whose place and speed depend on the seed; `tracer` holds the static scene."""
    rng = generator(seed, "walker")
    outfit = office.walkers[int(rng.integers(len(office.walkers)))]
    start = float(rng.uniform(0, 2 * (office.plan.length - 2 * _END_M)))
    return [Walker(office, tracer, outfit, float(rng.uniform(0.7, 1.1)), start)]
