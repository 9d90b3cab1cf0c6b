"""Every variant of one scene: the frames are the scene's, and the scores are the same whichever way it was encoded."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from analytic_scene import CLASSES, START_NS, Scene, camera_pose
from played import EVERY, Played, play
from variant import Equal, Variant
from variants_table import SECTIONS, VARIANTS

from stsem.classes import NO_LABEL
from stsem.frame import Frame
from stsem.log.log import Log, open_log
from stsem.log.pixels.encodings import ENCODINGS

SCORES = ("offline", "delivered", "streaming")
COUNTS = {"pixels", "class_pixels"}


def opened(variant: Variant, folder: Path, stack: ExitStack) -> Log:
    """The variant, written to `folder` and opened."""
    data = folder / "data"
    data.mkdir()
    paths = stack.enter_context(variant.reach(variant.written(data)))
    options = dict(variant.opened)
    if variant.classes_file:
        name, text = variant.classes_file
        options["classes_file"] = folder / name
        options["classes_file"].write_text(text)
    return stack.enter_context(open_log(paths, **options))


@pytest.fixture(scope="module")
def plainly(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Scene], Played]:
    """What a scene gives when it is recorded plainly, by a camera without distortion; each scene once."""
    known: dict[Scene, Played] = {}

    def played(scene: Scene) -> Played:
        if scene not in known:
            with ExitStack() as stack:
                plain = Variant("", "", scene=scene)
                known[scene] = play(opened(plain, tmp_path_factory.mktemp("plain"), stack))
        return known[scene]

    return played


@pytest.mark.parametrize("variant", VARIANTS.values(), ids=VARIANTS)
def test_scores_are_the_same_however_it_was_recorded(
    variant: Variant, tmp_path: Path, plainly: Callable[[Scene], Played]
) -> None:
    """The whole product path, from the file to the numbers of the report."""
    equal = variant.equal
    with ExitStack() as stack:
        log = opened(variant, tmp_path, stack)
        check_frames(log, variant)
        played = play(log)
        assert not log.info.damage.lossy
        check_warnings(log.info.warnings, equal)
    plain = plainly(replace(variant.scene.straight, start_ns=START_NS))
    for mode, run in played.runs.items():
        check_scores(run, plain.runs[mode], equal)
        if not equal.scores:
            assert_independent(run["offline"], variant.scene, EVERY if mode == "keyframe" else 1)
        if equal.map:
            check_map(played, plain, mode, equal)


def check_frames(log: Log, variant: Variant) -> None:
    """Every pixel, depth, pose, camera and label beside the scene's."""
    scene, equal = variant.scene, variant.equal
    assert [plan.stamp_ns - log.plans[0].stamp_ns for plan in log.plans] == [
        scene.stamp_ns(i) - scene.start_ns for i in range(scene.frames)
    ]
    assert log.plans[0].stamp_ns == scene.start_ns
    assert log.classes is not None
    assert log.classes.names == CLASSES
    for loaded in log.frames(range(scene.frames), depth=True, previous=False, truth=True):
        frame, view = loaded.frame, scene.straight.views[loaded.index]
        assert frame is not None
        check_color(frame.image, view.rgb, equal)
        check_depth(frame.depth, view.metres, equal)
        check_place(frame, scene, equal)
        assert (loaded.truth is not None) == scene.has_truth(loaded.index)
        if loaded.truth is not None:
            check_labels(loaded.truth, view.labels, equal)


def check_color(image: np.ndarray, rgb: np.ndarray, equal: Equal) -> None:
    wanted = rgb[:, :, [1, 1, 1]] if equal.grey else rgb
    assert image.shape == wanted.shape
    error = float(np.mean((image.astype(float) - wanted) ** 2))
    decibels = np.inf if error == 0 else 10 * np.log10(255**2 / error)
    assert decibels >= equal.color_db


def check_depth(depth: np.ndarray | None, metres: np.ndarray, equal: Equal) -> None:
    if equal.depth_m is None:
        assert depth is None
        return
    assert depth is not None
    if equal.depth_share == 1:
        np.testing.assert_allclose(depth, metres, rtol=0, atol=equal.depth_m)
        return
    known = np.isfinite(metres)
    assert (np.abs(depth - metres)[known] <= equal.depth_m).mean() >= equal.depth_share


def check_place(frame: Frame, scene: Scene, equal: Equal) -> None:
    assert (frame.camera is not None, frame.T_WC is not None) == (equal.camera, equal.pose)
    if frame.camera is not None:
        camera = scene.straight.camera
        assert (frame.camera.width, frame.camera.height) == (camera.width, camera.height)
        assert not frame.camera.is_distorted
        np.testing.assert_allclose(frame.camera.K, camera.K, rtol=1e-12)
    if frame.T_WC is not None:
        np.testing.assert_allclose(frame.T_WC, camera_pose(frame.index), rtol=0, atol=1e-9)


def check_labels(truth: np.ndarray, labels: np.ndarray, equal: Equal) -> None:
    times = round(equal.pixels**0.5)
    wanted = labels.repeat(times, 0).repeat(times, 1)
    assert truth.shape == wanted.shape
    assert (truth == wanted).mean() >= equal.labels_share


def check_warnings(warnings: tuple[str, ...], equal: Equal) -> None:
    """All that are expected, and no others."""
    unexpected = [said for said in warnings if not said.startswith(equal.warns or "\0")]
    missing = [begin for begin in equal.warns if not any(said.startswith(begin) for said in warnings)]
    assert (unexpected, missing) == ([], [])


def check_scores(run: dict[str, Any], plain: dict[str, Any], equal: Equal) -> None:
    """The numbers of one mode beside those of the plain recording."""
    if equal.scores:
        for name in SCORES:
            assert run[name]["miou"] == pytest.approx(plain[name]["miou"], abs=equal.scores)
            assert run[name]["pixel_accuracy"] == pytest.approx(plain[name]["pixel_accuracy"], abs=equal.scores)
        return
    assert comparable(run, equal) == comparable(plain, equal)


def comparable(run: dict[str, Any], equal: Equal) -> dict[str, Any]:
    """What of a run must be the same."""
    kept = {"offline", "strata", "by_distance"}
    if equal.timing != "other":
        kept |= {
            "consistency",
            "delivered",
            "streaming",
            "loss",
            "outcomes",
            "keyframes",
            "keyframe_reasons",
            "coverage",
        }
    if equal.timing == "same":
        kept = set(run) - ({"map", "not_measured"} if not equal.map else set())
    found = {name: run[name] for name in sorted(kept)}
    return without(found, (COUNTS if equal.pixels > 1 else set()) | ({"ms"} if equal.timing == "other" else set()))


def without(value: Any, names: set[str]) -> Any:
    """`value` without the entries of these names, at any depth."""
    if isinstance(value, dict):
        return {name: without(inner, names) for name, inner in value.items() if name not in names}
    return [without(inner, names) for inner in value] if isinstance(value, list | tuple) else value


def check_map(played: Played, plain: Played, mode: str, equal: Equal) -> None:
    """The labelled points of the map, in their order."""
    points, wanted = played.points[mode], plain.points[mode]
    assert points is not None
    assert wanted is not None
    np.testing.assert_allclose(points.xyz, wanted.xyz, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(points.labels, wanted.labels)
    if equal.color_db == np.inf and not equal.grey:
        np.testing.assert_array_equal(points.rgb, wanted.rgb)


def assert_independent(score: dict[str, Any], scene: Scene, every: int) -> None:
    """The offline score, counted here from the scene's labels: each keyframe's are held until the next one."""
    scored = [i for i in range(scene.frames) if scene.has_truth(i)]
    keyframes = keyframes_of(scene, every)
    held = [max(k for k in keyframes if k <= i) for i in scored if i >= keyframes[0]]
    truth = np.stack([scene.views[i].labels for i in scored if i >= keyframes[0]])
    answer = np.stack([scene.views[k].labels for k in held])
    answer, truth = answer[truth != NO_LABEL], truth[truth != NO_LABEL]
    ious = [((truth == c) & (answer == c)).sum() / ((truth == c) | (answer == c)).sum() for c in np.unique(truth)]
    assert score["miou"] == pytest.approx(sum(ious) / len(ious), abs=1e-12)
    assert score["pixel_accuracy"] == pytest.approx((truth == answer).mean(), abs=1e-12)


def keyframes_of(scene: Scene, every: int) -> list[int]:
    """Every so many frames; where one has no truth, the next that has."""
    found: list[int] = []
    for i in range(scene.frames):
        if scene.has_truth(i) and (not found or i - found[-1] >= every):
            found.append(i)
    return found


def test_the_scene_can_tell_modes_and_passes_apart(plainly: Callable[[Scene], Played]) -> None:
    """Scores that are all 1 would be the same whatever happened."""
    per_frame, keyframe = (plainly(Scene()).runs[mode] for mode in ("per-frame", "keyframe"))
    assert per_frame["offline"]["miou"] == 1
    assert 0.4 < keyframe["streaming"]["miou"] < keyframe["offline"]["miou"] - 0.1 < 0.8
    assert per_frame["outcomes"]["dropped_busy"] > 2
    assert per_frame["map"]["points"] > keyframe["map"]["points"] > 1000
    assert len(keyframe["by_distance"]) == EVERY


def test_every_encoding_is_a_variant() -> None:
    """Of the table of raw encodings; depth and labels have those that are no colour."""
    told = {name.partition("-")[2] for name in VARIANTS if name.partition("-")[0] in ("color", "depth", "labels")}
    assert set(ENCODINGS) <= told


def test_names_are_unique() -> None:
    assert len(VARIANTS) == sum(map(len, SECTIONS.values()))
