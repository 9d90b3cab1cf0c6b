"""A made-up walk in circles, its odometry and its loops, some of them false."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.pose import inverse
from stsem.slam.posegraph import Edge, moved
from stsem.slam.rotations import exponential

TRANSLATION_M, ROTATION_RAD = 0.01, 0.004
INFORMATION = np.diag([TRANSLATION_M**-2] * 3 + [ROTATION_RAD**-2] * 3)


@dataclass(frozen=True, eq=False)
class Graph:
    """True poses, those of dead reckoning, and the edges: odometry, true loops, false loops."""

    truth: npt.NDArray[np.float64]
    start: npt.NDArray[np.float64]
    edges: list[Edge]

    def error_m(self, poses: npt.NDArray[np.float64]) -> float:
        return float(np.sqrt(((poses - self.truth)[:, :3, 3] ** 2).sum(axis=1).mean()))


def graph(nodes: int, loops: int, *, false: int = 0, seed: int = 0, noise: float = 1.0) -> Graph:
    """Three rounds of a circle of 5 m; loops join one round to the next; false ones claim to stand at one place."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0, 6 * np.pi, nodes)
    truth = np.tile(np.eye(4), (nodes, 1, 1))
    truth[:, :3, 3] = np.column_stack([5 * np.cos(turn), 5 * np.sin(turn), 0.2 * np.sin(3 * turn)])
    truth[:, :3, :3] = exponential(turn[:, None] * [0.1, 0.0, 1.0])

    def edge(first: int, second: int, *, is_loop: bool) -> Edge:
        step = np.concatenate([rng.normal(0, TRANSLATION_M, 3), rng.normal(0, ROTATION_RAD, 3)]) * noise
        T = moved((inverse(truth[first]) @ truth[second])[None], step[None])[0]
        return Edge(first, second, T, INFORMATION, is_loop)

    edges = [edge(i, i + 1, is_loop=False) for i in range(nodes - 1)]
    start = [truth[0]]
    for odometry in edges:
        start.append(start[-1] @ odometry.T)
    starts = rng.integers(0, 2 * nodes // 3 - 3, loops).tolist()
    edges += [edge(i, i + nodes // 3 + int(rng.integers(-3, 4)), is_loop=True) for i in starts]
    for _ in range(false):
        first, second = sorted(rng.choice(nodes, 2, replace=False).tolist())
        edges.append(Edge(first, second, moved(np.eye(4)[None], rng.normal(0, 0.3, (1, 6)))[0], INFORMATION, True))
    return Graph(truth, np.array(start), edges)
