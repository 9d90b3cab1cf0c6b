"""Rendering to a file: the same bytes for the same arguments, exact truth in it, and nothing left when it fails."""

import hashlib
import os
import subprocess
import sys
import weakref
from collections.abc import Generator
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from stsem.errors import MissingExtraError, OutputError, UsageError
from stsem.log.log import open_log
from stsem.synth import generate
from stsem.synth.generate import RenderedFrame, office_camera, render_frames, render_log
from stsem.synth.scene import Scene
from stsem.synth.vocabulary import OFFICE

SHORT: dict[str, Any] = {
    "seed": 3, "layout": 11, "width": 64, "height": 48, "rate_hz": 10, "length_s": 0.6, "noise": "none",
    "speed": "steady",
}  # fmt: skip


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def made_up_frames(count: int, period_ns: int = 10**8) -> Generator[RenderedFrame, None, None]:
    """Frames that cost nothing."""
    for i in range(count):
        image, depth = np.full((48, 64, 3), i % 256, np.uint8), np.full((48, 64), 1.5, np.float32)
        yield RenderedFrame(
            generate.START_NS + i * period_ns, image, depth, np.zeros((48, 64), np.uint8), np.eye(4)
        )  # fmt: skip


@pytest.mark.render
def test_other_processes_and_thread_settings_write_the_same_bytes(rendered: Any, tmp_path: Path) -> None:
    """One thread where there were several, or several where there was one, and another order of Python's sets."""
    script = (
        "from pathlib import Path; import sys; from stsem.synth.generate import render_log; "
        f"render_log(Path(sys.argv[1]), label_every=2, **{rendered.asked!r})"
    )
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM", "PYTHONHASHSEED")
    threads = "4" if os.environ.get("OMP_NUM_THREADS") == "1" else "1"
    path, settings = tmp_path / "again.mcap", os.environ | dict.fromkeys(names, threads)
    subprocess.run([sys.executable, "-c", script, str(path)], env=settings, check=True, timeout=300)
    assert sha256(path) == sha256(rendered.path)


@pytest.mark.render
def test_another_layout_is_another_log(rendered: Any) -> None:
    """Already the first frame differs, in colour, labels and pose."""
    first, other = rendered.frames[0], next(render_frames(**SHORT | {"layout": 12}))
    assert np.abs(first.image.astype(int) - other.image).mean() > 5
    assert (first.labels != other.labels).mean() > 0.05
    assert np.abs(first.T_WC - other.T_WC).max() > 0.05


@pytest.mark.render
def test_another_seed_is_another_walk_and_other_noise(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Through the same building; it may start before the same door, of three."""
    monkeypatch.setattr(generate, "Scene", lambda *_: scene)
    frames = [next(render_frames(**SHORT | {"seed": seed, "noise": "kinect"})) for seed in (1, 1, 2, 3, 4)]
    np.testing.assert_array_equal(frames[0].image, frames[1].image)
    np.testing.assert_array_equal(frames[0].depth, frames[1].depth)
    assert len({tuple(frame.T_WC[:2, 3].tolist()) for frame in frames}) > 1
    assert len({frame.depth.tobytes() for frame in frames}) == 4


@pytest.mark.render
def test_the_log_has_what_was_rendered(rendered: Any) -> None:
    """Depth to half a millimetre, poses to 1e-9, labels exactly, colour as JPEG keeps it, truth for every second."""
    with open_log([rendered.path]) as log:
        assert not log.info.damage.lossy
        assert log.info.warnings == ()
        assert log.classes == OFFICE
        assert log.camera is not None
        np.testing.assert_array_equal(log.camera.K, office_camera(64, 48).K)
        assert not log.camera.is_distorted
        assert len(log.plans) == len(rendered.frames) == 6
        for index, frame in enumerate(rendered.frames):
            read, truth = log.frame(index, depth=True, previous=False), log.truth(index)
            assert read.stamp_ns == frame.stamp_ns
            assert read.depth is not None
            assert read.T_WC is not None
            assert np.abs(read.depth - frame.depth).max() <= 0.0005 + 1e-6
            np.testing.assert_allclose(read.T_WC, frame.T_WC, atol=1e-9)
            assert np.abs(read.image.astype(int) - frame.image).mean() < 6
            assert (truth is not None) == (index % 2 == 0)
            if truth is not None:
                np.testing.assert_array_equal(truth, frame.labels)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"width": 16}, "16x48 were asked for; each side must be from 32 to 4096"),
        ({"height": 5000}, "64x5000"),
        ({"rate_hz": 0}, "0 frames per second"),
        ({"rate_hz": float("nan")}, "nan frames per second"),
        ({"rate_hz": 1000}, "give 0.1 to 240"),
        ({"length_s": 0}, "A length of 0 s"),
        ({"length_s": float("inf")}, "at most a day"),
        ({"noise": "salt"}, "'salt'; give kinect or none"),
        ({"speed": "fast"}, "'fast'; give steady, searching, varying"),
        ({"label_every": 0}, "every 0 frames"),
    ],
)
def test_values_that_cannot_be_are_refused_before_anything_happens(
    tmp_path: Path, change: dict[str, Any], sentence: str
) -> None:
    """One sentence, and no file."""
    with pytest.raises(UsageError, match=sentence):
        render_log(tmp_path / "x.mcap", **SHORT | change)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["nowhere/x.mcap", "folder"])
def test_a_place_that_cannot_be_written_is_told_before_rendering(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """No folder, or a folder where the file should be; the scene is never built."""
    (tmp_path / "folder").mkdir()
    monkeypatch.setattr(generate, "Scene", lambda *_: pytest.fail("the scene was built"))
    with pytest.raises(OutputError, match="cannot be written"):
        render_log(tmp_path / place, **SHORT)
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_an_interruption_leaves_no_file_and_closes_the_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C after the third frame; an earlier log of the same name stays."""
    frames, path = made_up_frames(10), tmp_path / "x.mcap"
    path.write_bytes(b"an earlier log")
    monkeypatch.setattr(generate, "render_frames", lambda **_: frames)

    def interrupt(done: int, _: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_log(path, progress=interrupt, **SHORT)
    assert [p.name for p in tmp_path.iterdir()] == ["x.mcap"]
    assert path.read_bytes() == b"an earlier log"
    assert list(frames) == []


def test_frames_are_written_and_forgotten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 240 Hz about five frames are under way at a time, whatever the length; messages come in order of log time."""
    alive: weakref.WeakSet[RenderedFrame] = weakref.WeakSet()
    most = 0

    def watched() -> Generator[RenderedFrame, None, None]:
        nonlocal most
        for frame in made_up_frames(240, 10**9 // 240):
            alive.add(frame)
            most = max(most, len(alive))
            yield frame

    monkeypatch.setattr(generate, "render_frames", lambda **_: watched())
    done: list[tuple[int, int]] = []
    render_log(
        tmp_path / "x.mcap", progress=lambda *counts: done.append(counts), **SHORT | {"rate_hz": 240, "length_s": 1}
    )
    assert most <= 10
    assert done[-1] == (240, 240)
    with open_log([tmp_path / "x.mcap"]) as log:
        assert len(log.plans) == 240
        assert all(plan.truth_log_ns is not None for plan in log.plans)


@pytest.fixture
def no_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames without anything in them."""
    for name in ("Scene", "walk", "pose_at", "_captured"):
        monkeypatch.setattr(generate, name, MagicMock())


@pytest.mark.parametrize(
    ("rate_hz", "length_s", "count"), [(100, 4.35, 435), (10, 15, 150), (3, 0.1, 1), (30, 1.99, 59)]
)
def test_the_length_says_how_many_frames(no_scene: None, rate_hz: float, length_s: float, count: int) -> None:
    """Rate times length, rounded down but for rounding errors, at least one."""
    assert len(list(render_frames(**SHORT | {"rate_hz": rate_hz, "length_s": length_s}))) == count


def test_frames_can_be_given_up(no_scene: None) -> None:
    """Closing the iterator ends it."""
    frames = render_frames(**SHORT)
    next(frames)
    frames.close()
    assert list(frames) == []


def test_without_the_extra_there_is_a_sentence_and_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says what to install."""
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'stsem\[synth\]'"):
        render_log(tmp_path / "x.mcap", **SHORT)
    assert list(tmp_path.iterdir()) == []
