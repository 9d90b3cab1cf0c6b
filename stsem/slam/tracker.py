"""RGB-D odometry: each frame against the last keyframe, by points first and by depth to the end; lost is a state."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from stsem.camera import Camera
from stsem.chance import hash31
from stsem.frame import Frame
from stsem.pose import Pose, inverse
from stsem.slam.align import Agreement, Aligned, align, shared
from stsem.slam.keyframe import Keyframe, is_far
from stsem.slam.landmarks import FEW, MANY, Landmarks, Resection, find_landmarks, resect, zoomed
from stsem.slam.planes import PlaneGrid, plane_grid
from stsem.slam.posegraph import Edge
from stsem.slam.recognise import most_alike
from stsem.slam.sighting import Sighting, sighting
from stsem.slam.verify import MIN_AGREEMENT, MIN_OVERLAP, depth_agreement
from stsem.slam.zoom import Zoom

MAX_TRANSLATION_M, MAX_ROTATION_DEG, MIN_KEYFRAME_SHARE = 0.15, 12.0, 0.6
"""A frame farther from its keyframe, or that sees less of it, becomes a keyframe."""
NEIGHBOURS = 6
"""Keyframes that a new one is aligned to: those that share most of what it sees."""
NEIGHBOUR_M, NEIGHBOUR_COSINE = 3.0, 0.5
PROMOTION_STEPS = 6
"""Largest number of steps of a new keyframe's alignment to all of them at once."""
MIN_SHARE, MAX_RESIDUAL, MIN_INFORMATION = 0.3, 1.0, 100.0
"""Less agreement of depth is lost. Information: a standard deviation of 10 cm or 0.1 rad in the worst direction."""
MIN_INLIERS = 20
"""Points on which a pose is believed with no depth to confirm it."""
MIN_RELOCALISED_INLIERS = 12
"""Points on which depth is asked whether a lost camera is where they say."""
MIN_POINTS = 500
"""Cells with a plane below which a frame counts as without depth."""
MIN_SIGHTED = 12
"""Points that are heard in the alignment of depth."""
SURE_INFORMATION = 5e4
"""Depth that leaves less than 4.5 mm and rad in the worst direction alone shows how colour and depth are registered."""
ZOOM_STEP = 0.002
"""Change of the ratio of focal lengths that is worth placing all landmarks anew."""
CANDIDATES = 3
MAX_WEIGHT, MEMORY = 30.0, 30.0


class Status(StrEnum):
    """How a frame's pose came about."""

    KEYFRAME = "keyframe"
    TRACKED = "tracked"
    RELOCALISED = "relocalised"
    LOST = "lost"


@dataclass(frozen=True, eq=False)
class Tracked:
    """The answer for one frame.

    Args:
        T_WC: (4, 4), world from camera, the world being the camera of the first keyframe; None when lost.
        status: how it came about.
        keyframe: position among the keyframes of the one it was measured against (itself if it is one); None if lost.
        inliers: points that agree with the pose by PnP; 0 where depth alone made it.
        matches: points that were compared.
        share: of the depth that met the keyframe's surface, 0..1.
        reason: why it is lost, "" otherwise.
    """

    T_WC: Pose | None
    status: Status
    keyframe: int | None
    inliers: int = 0
    matches: int = 0
    share: float = 0.0
    reason: str = ""


@dataclass(frozen=True, eq=False)
class _View:
    """The current frame as it is measured."""

    frame: Frame
    landmarks: Landmarks
    grid: PlaneGrid | None


class Tracker:
    """Follows an RGB-D camera frame by frame, each frame once, in order.

    Args:
        camera: of image and depth, without distortion.
        seed: same frames and seed, same bytes, for any number of threads.

    Attributes:
        keyframes: in order; the first is the world. Replaced, never changed: loop closure may assign moved ones.
        edges: motions measured between keyframes, for the pose graph.
    """

    def __init__(self, camera: Camera, seed: int) -> None:
        self._camera, self._seed = camera, seed
        self.keyframes: list[Keyframe] = []
        self.edges: list[Edge] = []
        self._current = 0
        self._T_KC: Pose | None = None
        self._velocity: Pose = np.eye(4)
        self._zoom, self._ratio = Zoom(), 1.0

    def track(self, frame: Frame) -> Tracked:
        """The pose of `frame`, measured against the current keyframe, or found again among all of them."""
        if frame.size != (self._camera.width, self._camera.height):
            width, height = frame.size
            return self._lose(f"image of {width}x{height}, but a camera of {self._camera.width}x{self._camera.height}")
        view = self._view(frame)
        if not self.keyframes:
            return self._begin(view)
        found = self._relocalise(view) if self._T_KC is None else self._follow(view, self._T_KC)
        self._rezoomed()
        return found

    def move(self, poses: list[Pose]) -> None:
        """Gives the keyframes the poses (one each, T_WC) that a pose graph found; tracking goes on from there."""
        self.keyframes = [replace(one, T_WC=pose) for one, pose in zip(self.keyframes, poses, strict=True)]

    def _view(self, frame: Frame) -> _View:
        most = MANY if self._T_KC is None else FEW
        landmarks = self._landmarks(frame, most)
        grid = None if frame.depth is None else plane_grid(frame.depth, self._camera)
        enough = grid is not None and np.count_nonzero(grid.planes[:, 4]) >= MIN_POINTS
        return _View(frame, landmarks, grid if enough else None)

    def _landmarks(self, frame: Frame, most: int) -> Landmarks:
        found = find_landmarks(frame.image, frame.depth, self._camera, most=most)
        return found if self._ratio == 1.0 else zoomed(found, self._ratio, frame.depth, self._camera)

    def _begin(self, view: _View) -> Tracked:
        if view.grid is None:
            return _lost("no depth to begin with")
        self._add(view, view.grid, np.eye(4))
        return Tracked(np.eye(4), Status.KEYFRAME, 0, share=1.0)

    def _follow(self, view: _View, T_KC: Pose) -> Tracked:
        keyframe = self.keyframes[self._current]
        seen = resect(keyframe.landmarks, view.landmarks, self._camera, seed=self._draw(view, self._current))
        predicted = keyframe.T_WC @ T_KC @ self._velocity
        if view.grid is None:
            return self._by_points(view, keyframe, seen)
        found, points = self._refined(view.grid, keyframe, seen, predicted)
        if reason := _doubt(found.agreement, seen):
            return self._lose(reason)
        return self._accept(view, found, seen, points, Status.TRACKED)

    def _by_points(self, view: _View, keyframe: Keyframe, seen: Resection | None) -> Tracked:
        if seen is None or seen.inliers < MIN_INLIERS:
            return self._lose("no depth, and too few points seen again")
        self._velocity, self._T_KC = np.eye(4), seen.T_KC
        pose = keyframe.T_WC @ seen.T_KC
        return Tracked(pose, Status.TRACKED, self._current, seen.inliers, seen.matches)

    def _relocalise(self, view: _View) -> Tracked:
        if view.grid is None:
            return self._lose("lost, and no depth to be found again by")
        alike = most_alike(view.landmarks, [one.landmarks for one in self.keyframes], CANDIDATES)
        for position in dict.fromkeys([self._current, *alike]):  # a camera is seldom far from where it was lost
            keyframe = self.keyframes[position]
            seen = resect(keyframe.landmarks, view.landmarks, self._camera, seed=self._draw(view, position))
            if seen is None or seen.inliers < MIN_RELOCALISED_INLIERS:
                continue
            found, points = self._refined(view.grid, keyframe, seen, keyframe.T_WC @ seen.T_KC)
            overlap, same = depth_agreement(keyframe.grid, view.grid, inverse(keyframe.T_WC) @ found.T_WC)
            if overlap >= MIN_OVERLAP and same >= MIN_AGREEMENT and not _doubt(found.agreement, seen):
                self._current, self._T_KC = position, inverse(keyframe.T_WC) @ found.T_WC
                return self._accept(view, found, seen, points, Status.RELOCALISED)
        return self._lose("lost, and no keyframe recognised")

    def _refined(
        self, grid: PlaneGrid, keyframe: Keyframe, seen: Resection | None, predicted: Pose
    ) -> tuple[Aligned, Sighting | None]:
        """By depth and points at once, from whichever start meets more of the keyframe's surface; and those points."""
        likely = [predicted]
        if seen is not None and seen.inliers >= MIN_INLIERS:
            few = grid.points(4)
            likely.append(keyframe.T_WC @ seen.T_KC)
            likely.sort(key=lambda pose: -shared(few, keyframe.reference, pose))
        points = None if seen is None else sighting(seen, keyframe.T_WC, self._camera, likely, self._zoom.spread)
        if points is not None and len(points.xy) < MIN_SIGHTED:
            points = None
        found = align([(grid.points(4), 4), (grid.points(2), 3)], [keyframe.reference], likely[0], points)
        if points is not None and not self._zoom.settled:
            self._learn_zoom(grid, keyframe, points, found)
        return found, points

    def _learn_zoom(self, grid: PlaneGrid, keyframe: Keyframe, points: Sighting, found: Aligned) -> None:
        """Compares the flow of points with the motion that depth finds without them, where that is sure."""
        alone = align([(grid.points(2), 3)], [keyframe.reference], found.T_WC)
        if float(np.linalg.eigvalsh(alone.agreement.information)[0]) < SURE_INFORMATION:
            return
        before = points.errors(keyframe.T_WC)[1] + points.xy
        expected = points.errors(alone.T_WC)[1] + points.xy - before
        self._zoom.add(expected, (points.xy - before) / self._ratio)

    def _rezoomed(self) -> None:
        """Takes the ratio of focal lengths as it is known now, and places all landmarks by it.

        When it is settled, depth images are let go: they would be half of what a keyframe holds.
        """
        change = self._zoom.ratio / self._ratio
        if abs(change - 1) > ZOOM_STEP:
            self._ratio = self._zoom.ratio
            self.keyframes = [
                replace(one, landmarks=zoomed(one.landmarks, change, one.depth, self._camera)) for one in self.keyframes
            ]
        if self._zoom.settled and self.keyframes[-1].depth is not None:
            self.keyframes = [one if one.depth is None else replace(one, depth=None) for one in self.keyframes]

    def _accept(
        self, view: _View, found: Aligned, seen: Resection | None, points: Sighting | None, status: Status
    ) -> Tracked:
        assert view.grid is not None
        keyframe, share = self.keyframes[self._current], found.agreement.share
        T_KC = inverse(keyframe.T_WC) @ found.T_WC
        if self._T_KC is not None:
            self._velocity = inverse(self._T_KC) @ T_KC
        self._T_KC = T_KC
        pose, inliers, matches = found.T_WC, seen.inliers if seen else 0, seen.matches if seen else 0
        far = is_far(T_KC, max_translation_m=MAX_TRANSLATION_M, max_rotation_deg=MAX_ROTATION_DEG)
        if status is Status.TRACKED and (far or share < MIN_KEYFRAME_SHARE):
            pose, status = self._promote(view, view.grid, found.T_WC, points), Status.KEYFRAME
        else:
            grid = keyframe.grid.blended(view.grid, T_KC, max_weight=MAX_WEIGHT, memory=1.0)
            self.keyframes[self._current] = replace(keyframe, grid=grid)
        return Tracked(pose, status, self._current, inliers, matches, share)

    def _promote(self, view: _View, grid: PlaneGrid, T_WC: Pose, seen: Sighting | None) -> Pose:
        """Makes the frame a keyframe: aligned to its neighbours all at once, with an edge to each. Returns its pose."""
        coarse = grid.points(8)
        shares = [
            shared(coarse, one.reference, T_WC) if _looks_alike(one.T_WC, T_WC) else 0.0 for one in self.keyframes
        ]
        best = np.argsort(-np.array(shares), kind="stable")[:NEIGHBOURS]
        chosen = [int(one) for one in best if shares[one] >= MIN_SHARE and one != self._current] + [self._current]
        references = [self.keyframes[one].reference for one in chosen]
        found = align([(grid.points(2), PROMOTION_STEPS)], references, T_WC, seen)
        pose = found.T_WC
        for position, reference, agreed in zip(chosen, references, found.agreements, strict=True):
            information = agreed.information + np.eye(6)
            if seen is not None and position == self._current:
                information = information + seen.system(pose)[0]
            self.edges.append(Edge(position, len(self.keyframes), inverse(reference.T_WC) @ pose, information))
        last = self.keyframes[self._current]
        known = grid.blended(last.grid, inverse(pose) @ last.T_WC, max_weight=MAX_WEIGHT, memory=MEMORY)
        self._add(view, known, pose)
        return pose

    def _add(self, view: _View, grid: PlaneGrid, T_WC: Pose) -> None:
        frame = view.frame
        assert frame.depth is not None
        landmarks = self._landmarks(frame, MANY)
        self.keyframes.append(Keyframe(frame.index, frame.stamp_ns, T_WC, landmarks, frame.depth, grid))
        self._current, self._T_KC = len(self.keyframes) - 1, np.eye(4)

    def _lose(self, reason: str) -> Tracked:
        self._T_KC, self._velocity = None, np.eye(4)
        return _lost(reason)

    def _draw(self, view: _View, keyframe: int) -> int:
        return hash31(self._seed, "pnp", view.frame.index, keyframe)


def _lost(reason: str) -> Tracked:
    return Tracked(None, Status.LOST, None, reason=reason)


def _looks_alike(one: Pose, other: Pose) -> bool:
    """Whether two cameras are near and look much the same way, so that they may see the same surface."""
    near = float(np.linalg.norm(one[:3, 3] - other[:3, 3])) < NEIGHBOUR_M
    return near and float(one[:3, 2] @ other[:3, 2]) > NEIGHBOUR_COSINE


def _doubt(found: Agreement, seen: Resection | None) -> str:
    """Why an alignment is not believed; "" if it is."""
    if found.share < MIN_SHARE or found.residual > MAX_RESIDUAL:
        return f"depth agrees with the keyframe at {found.share:.0%} of the points only"
    certain = float(np.linalg.eigvalsh(found.information)[0]) >= MIN_INFORMATION
    if not certain and (seen is None or seen.inliers < MIN_INLIERS):
        return "too few points seen again, and depth alone does not fix the pose"
    return ""
