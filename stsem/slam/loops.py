"""Loops: keyframes that see again what an earlier one saw. A false one does more harm than ten missed ones.

A loop counts only when (1) the views look alike, (2) the walk between them could have led back here, given how far
odometry drifts, (3) points and depth agree (`verify`), and (4) a neighbour of the earlier keyframe, verified on its
own, puts this view at the same place.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stsem.chance import hash31
from stsem.pose import Pose, inverse
from stsem.slam.posegraph import Edge
from stsem.slam.recall import Recall
from stsem.slam.rotations import F64, logarithm
from stsem.slam.verify import Match, View, verify

MIN_KEYFRAMES_BETWEEN = 12
MAX_CANDIDATES = 3
REST = 3
"""Keyframes after a closed loop in which none is sought: odometry drifts little in them."""
DRIFT_PER_METRE = 0.06
DRIFT_FLOOR_M = 0.25
DRIFT_DEG_PER_METRE = 2.0
DRIFT_FLOOR_DEG = 8.0
AGREE_M = 0.05
AGREE_DEG = 2.0
MAX_ANGLE_DEG = 60.0
MAX_DISTANCE_M = 4.0


@dataclass(frozen=True)
class Tried:
    """What became of a candidate: `too far`, `no match`, `alone` or `loop`."""

    keyframe: int
    candidate: int
    outcome: str
    inliers: int = 0


class Loops:
    """Finds loops as keyframes come.

    Args:
        seed: of the run.

    Attributes:
        tried: what became of the candidates, in order.
    """

    def __init__(self, seed: int) -> None:
        self.tried: list[Tried] = []
        self._seed, self._rested = seed, 0
        self._recall = Recall()
        self._views: list[View] = []

    def add(self, view: View, poses: Sequence[Pose] | F64) -> list[Edge]:
        """Take in the next keyframe; returns the loop edges from earlier ones to it, none or at least two.

        Args:
            view: the keyframe.
            poses: T_WC of all keyframes so far, this one last, as well as they are known now.
        """
        here, at = len(self._views), np.asarray(poses)
        words = self._recall.words(view.landmarks.descriptors)
        alike = self._recall.similarity(words)
        self._recall.add(words)
        self._views.append(view)
        if here <= self._rested:
            return []
        for candidate in self._candidates(alike, at):
            edges = self._confirmed(candidate, here, at)
            if edges:
                self._rested = here + REST
                return edges
        return []

    def _candidates(self, alike: F64, poses: F64) -> list[int]:
        """The earlier keyframes worth a closer look, the most alike first."""
        far_back = len(alike) - MIN_KEYFRAMES_BETWEEN
        if far_back <= 0:
            return []
        possible = np.flatnonzero(_reachable(poses)[:far_back])
        order = possible[np.argsort(-alike[possible], kind="stable")]
        chosen: list[int] = []
        for candidate in order.tolist():
            if len(chosen) == MAX_CANDIDATES:
                break
            if all(abs(candidate - other) > 1 for other in chosen):
                chosen.append(candidate)
        return chosen

    def _confirmed(self, candidate: int, here: int, poses: F64) -> list[Edge]:
        """The loop edges to `candidate` and to a neighbour that agrees with it."""
        match = self._verified(candidate, here)
        if match is None or not _plausible(match.T, candidate, poses):
            self.tried.append(Tried(here, candidate, "no match" if match is None else "too far"))
            return []
        for neighbour in (candidate + 1, candidate - 1, candidate + 2, candidate - 2):
            if not 0 <= neighbour < here - MIN_KEYFRAMES_BETWEEN // 2:
                continue
            other = self._verified(neighbour, here)
            between = inverse(poses[candidate]) @ poses[neighbour]
            if other is not None and _agree(match.T, between @ other.T):
                self.tried.append(Tried(here, candidate, "loop", match.inliers))
                return [_edge(candidate, here, match), _edge(neighbour, here, other)]
        self.tried.append(Tried(here, candidate, "alone", match.inliers))
        return []

    def _verified(self, earlier: int, here: int) -> Match | None:
        seed = hash31(self._seed, "loop", earlier, here)
        return verify(self._views[earlier], self._views[here], seed=seed)


def _edge(earlier: int, here: int, match: Match) -> Edge:
    return Edge(earlier, here, match.T, match.information, is_loop=True)


def _walked(poses: F64) -> F64:
    """(n,) metres walked from each pose to the last one."""
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    return np.asarray(np.concatenate([np.cumsum(steps[::-1])[::-1], [0.0]]))


def _drift_m(poses: F64) -> F64:
    """(n,) how far off the last pose may be, seen from each."""
    return np.asarray(DRIFT_FLOOR_M + DRIFT_PER_METRE * _walked(poses))


def _reachable(poses: F64) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """(n,) poses from which the last view may show the same things, its drift granted."""
    walked = _walked(poses)
    distance = np.linalg.norm(poses[:, :3, 3] - poses[-1, :3, 3], axis=1)
    cosine = np.clip(poses[:, :3, 2] @ poses[-1, :3, 2], -1, 1)
    turned = np.degrees(np.arccos(cosine))
    near = distance <= MAX_DISTANCE_M + _drift_m(poses)
    return np.asarray(near & (turned <= MAX_ANGLE_DEG + DRIFT_FLOOR_DEG + DRIFT_DEG_PER_METRE * walked))


def _plausible(T: Pose, candidate: int, poses: F64) -> bool:
    """Whether odometry may have drifted from the pose that the match says to the one it has."""
    off = inverse(T) @ inverse(poses[candidate]) @ poses[-1]
    turned = float(np.degrees(np.linalg.norm(logarithm(off[:3, :3]))))
    may_turn = DRIFT_FLOOR_DEG + DRIFT_DEG_PER_METRE * float(_walked(poses)[candidate])
    return float(np.linalg.norm(off[:3, 3])) <= float(_drift_m(poses)[candidate]) and turned <= may_turn


def _agree(one: Pose, other: Pose) -> bool:
    off = inverse(one) @ other
    turned = float(np.degrees(np.linalg.norm(logarithm(off[:3, :3]))))
    return float(np.linalg.norm(off[:3, 3])) <= AGREE_M and turned <= AGREE_DEG
