"""Ray casting with Embree (extra `synth`)."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.errors import MissingExtraError
from stsem.synth.mesh import F32, I32, Quads


@dataclass(frozen=True)
class Hits:
    """What n rays met.

    Args:
        distance: (n,) in units of the direction's length; inf for nothing.
        quad: (n,) index of the quad, -1 for nothing.
        a, b: (n,) position on the quad, 0..1 along its lower and its left edge.
    """

    distance: F32
    quad: I32
    a: F32
    b: F32


class Tracer:
    """Embree's tree over a bag of quads.

    Raises:
        MissingExtraError: embreex is not installed.
    """

    def __init__(self, quads: Quads) -> None:
        try:
            from embreex import rtcore_scene
            from embreex.mesh_construction import TriangleMesh
        except ImportError as err:
            raise MissingExtraError("synth", "Rendering logs") from err
        self._scene = rtcore_scene.EmbreeScene()
        self._mesh = TriangleMesh(self._scene, quads.triangles())

    def cast(self, origins: F32, directions: F32) -> Hits:
        """The nearest quad along each ray (n, 3)."""
        found = self._scene.run(origins, directions, output=1)
        primitive = np.asarray(found["primID"], np.int32)
        u, v = np.asarray(found["u"], np.float32), np.asarray(found["v"], np.float32)
        upper = (primitive & 1).astype(bool)
        missed = primitive < 0
        return Hits(
            np.where(missed, np.float32(np.inf), np.asarray(found["tfar"], np.float32)),
            np.where(missed, np.int32(-1), primitive >> 1),
            np.where(upper, u, u + v),
            np.where(upper, u + v, v),
        )

    def distance(self, origins: F32, directions: F32) -> F32:
        """(n,) distance to the nearest surface, in units of the direction's length; huge for nothing."""
        return np.asarray(self._scene.run(origins, directions, query="DISTANCE"), np.float32)

    def occluded(self, origins: F32, targets: F32) -> npt.NDArray[np.bool_]:
        """(n,) whether something stands between a point and its target (both (n, 3))."""
        reach = np.full(len(origins), 0.999, np.float32)
        hit = self._scene.run(origins, np.ascontiguousarray(targets - origins), reach, query="OCCLUDED")
        return np.asarray(hit, np.int32) >= 0
