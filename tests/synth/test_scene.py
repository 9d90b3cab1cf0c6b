"""What is seen: labels, depth and poses agree with each other and with the building."""

import numpy as np
import numpy.typing as npt
import pytest

from stsem import chance
from stsem.camera import Camera
from stsem.pose import Pose, inverse
from stsem.synth.floorplan import CEILING
from stsem.synth.generate import office_camera
from stsem.synth.path import pose_at, profile, walk
from stsem.synth.scene import Scene
from stsem.synth.view import View
from stsem.synth.vocabulary import OFFICE, Label
from stsem.synth.walkers import walker

pytestmark = pytest.mark.render

CAMERA = office_camera(160, 96)
WALK_S = 60.0


@pytest.fixture(scope="module")
def states(scene: Scene) -> npt.NDArray[np.float64]:
    return walk(scene.office, chance.hash31(1, "walk", 7002), WALK_S, profile("varying"))


def to_world(view: View, camera: Camera, T_WC: Pose) -> npt.NDArray[np.float64]:
    """(H, W, 3) points of a view: depth is measured along z, not along the ray."""
    y, x = np.mgrid[: camera.height, : camera.width]
    z = view.depth.astype(np.float64)
    points = np.stack([(x - camera.cx) / camera.fx * z, (y - camera.cy) / camera.fy * z, z], axis=-1)
    return np.asarray(points @ T_WC[:3, :3].T + T_WC[:3, 3], np.float64)


def agreement(earlier: View, later: View, T_earlier: Pose, T_later: Pose) -> tuple[float, float]:
    """(share of equal labels, share of pixels covered) of `later` looked up in `earlier`; persons left out."""
    points = to_world(later, CAMERA, T_later)
    T_CW = inverse(T_earlier)
    local = points @ T_CW[:3, :3].T + T_CW[:3, 3]
    z = np.maximum(local[..., 2], 1e-6)
    x = np.rint(local[..., 0] / z * CAMERA.fx + CAMERA.cx).astype(int)
    y = np.rint(local[..., 1] / z * CAMERA.fy + CAMERA.cy).astype(int)
    inside = (local[..., 2] > 0.1) & (x >= 0) & (x < CAMERA.width) & (y >= 0) & (y < CAMERA.height)
    x, y = np.clip(x, 0, CAMERA.width - 1), np.clip(y, 0, CAMERA.height - 1)
    covered = inside & (np.abs(earlier.depth[y, x] - z) < 0.02 * z) & (later.labels != Label.PERSON)
    return float((earlier.labels[y, x] == later.labels)[covered].mean()), float(covered.mean())


@pytest.mark.parametrize("time_s", [2.0, 9.0, 20.0, 33.0])
def test_exact_depth_and_poses_carry_labels_from_frame_to_frame(
    scene: Scene, states: npt.NDArray[np.float64], time_s: float
) -> None:
    """At least 97 % of what both frames show of the static scene; the rest is rounding to pixels at outlines."""
    before, now = pose_at(states, time_s), pose_at(states, time_s + 0.1)
    earlier, later = scene.look(CAMERA, before, time_s), scene.look(CAMERA, now, time_s + 0.1)
    equal, covered = agreement(earlier, later, before, now)
    assert equal > 0.97
    assert covered > 0.6


def test_a_wrong_pose_would_be_noticed(scene: Scene, states: npt.NDArray[np.float64]) -> None:
    """The same comparison with the pose of half a second later fails."""
    poses = [pose_at(states, time_s) for time_s in (9.0, 9.1, 9.6)]
    equal, covered = agreement(scene.look(CAMERA, poses[0], 9.0), scene.look(CAMERA, poses[1], 9.1), poses[0], poses[2])
    assert equal < 0.97 or covered < 0.6


def test_floor_and_ceiling_are_where_the_plan_has_them(scene: Scene, states: npt.NDArray[np.float64]) -> None:
    """Every pixel with their label, carried into the world by depth and pose, to a tenth of a millimetre."""
    heights: dict[Label, list[npt.NDArray[np.float64]]] = {Label.FLOOR: [], Label.CEILING: []}
    for time_s in np.arange(0.0, WALK_S, 6.0).tolist():
        T_WC = pose_at(states, time_s)
        view = scene.look(CAMERA, T_WC, time_s)
        for label, found in heights.items():
            found.append(to_world(view, CAMERA, T_WC)[view.labels == label][:, 2])
    for label, height in ((Label.FLOOR, 0.0), (Label.CEILING, CEILING)):
        measured = np.concatenate(heights[label])
        assert len(measured) > 500
        np.testing.assert_allclose(measured, height, atol=1e-4)


def test_every_class_is_seen_and_every_pixel_has_one(scene: Scene, states: npt.NDArray[np.float64]) -> None:
    """On a minute's walk; nothing is unlabelled, infinitely far or behind the camera."""
    camera, counts = office_camera(64, 48), np.zeros(256, np.int64)
    for time_s in np.arange(0.0, WALK_S, 3.0).tolist():
        view = scene.look(camera, pose_at(states, time_s), time_s)
        counts += np.bincount(view.labels.ravel(), minlength=256)
        assert np.isfinite(view.depth).all()
        assert 0.1 < view.depth.min() <= view.depth.max() < 15
        assert np.isfinite(view.radiance).all()
    assert (counts[: len(OFFICE)] > 30).all()
    assert not counts[len(OFFICE) :].any()


def test_walkers_are_persons_lit_and_labelled_as_such(scene: Scene) -> None:
    """Looked at from three metres in the corridor: about as tall as a person, with the label and in front."""
    person = walker(scene.office, scene.tracer, 1)[0]
    x, y, _ = person.place(2.0)
    side = 3.0 if x < scene.office.plan.length / 2 else -3.0
    T_WC = np.eye(4)
    T_WC[:3, 0], T_WC[:3, 1], T_WC[:3, 2] = (0, np.sign(side), 0), (0, 0, -1), (-np.sign(side), 0, 0)
    T_WC[:3, 3] = x + side, y, 1.0
    assert np.linalg.det(T_WC[:3, :3]) == pytest.approx(1)
    view = scene.look(CAMERA, T_WC, 2.0)
    seen = (view.labels == Label.PERSON) & (np.abs(view.depth - 3) < 0.6)
    heights = to_world(view, CAMERA, T_WC)[seen][:, 2]
    assert seen[:, 70:90].sum() > 300
    assert heights.min() < 0.15
    assert 1.5 < heights.max() < 2.0
    assert view.radiance[seen].max() > 0.02


def test_standing_persons_are_persons_too(scene: Scene) -> None:
    """Rays from below the lamps down to every spot where somebody was placed meet a person first."""
    spots = scene.office.furnishing.standing
    assert spots
    origins = np.array([(x, y, 1.97) for x, y, _ in spots], np.float32)
    hits = scene.tracer.cast(origins, np.tile(np.array([[0, 0, -1]], np.float32), (len(spots), 1)))
    assert (scene.office.quads.label[hits.quad] == Label.PERSON).all()
