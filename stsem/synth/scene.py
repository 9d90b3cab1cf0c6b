"""An office with its light and its walkers, ready to be photographed."""

import numpy as np

from stsem.camera import Camera
from stsem.pose import Pose
from stsem.synth.lighting import illuminate
from stsem.synth.office import build_office
from stsem.synth.tracer import Tracer
from stsem.synth.view import View, lit_body, look
from stsem.synth.walkers import walker


class Scene:
    """The floor of `layout`, lit once, with the people of `seed`.

    Attributes:
        office: what was built.
        tracer: its static surfaces.

    Raises:
        MissingExtraError: the extra `synth` is not installed.
    """

    def __init__(self, layout: int, seed: int) -> None:
        self.office = build_office(layout)
        quads = self.office.quads
        self.tracer = Tracer(quads)
        light = illuminate(quads, self.tracer, self.office.furnishing.lights)
        self._static = lit_body(quads, self.tracer, light, self.office.materials)
        self._people = walker(self.office, self.tracer, seed)

    def look(self, camera: Camera, T_WC: Pose, time_s: float) -> View:
        """What `camera` at `T_WC` would see `time_s` seconds into the walk, without any fault of a sensor."""
        bodies = [self._static, *(person.at(time_s) for person in self._people)]
        spots = np.array([person.place(time_s)[:2] for person in self._people], np.float64).reshape(-1, 2)
        return look(bodies, self.office.materials, camera, T_WC, spots)
