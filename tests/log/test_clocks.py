"""Clocks and stamps: what is taken out, what is refused, what is said; small logs whose clocks misbehave."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_logs import BASE_NS, LEVEL, NS, ROS, Recorder, label_picture, picture

from stsem.errors import LogError
from stsem.log.clocks import clock_offset_ns, find_resets
from stsem.log.log import open_log
from stsem.log.tracks import References

MS = 1_000_000
IMAGE, TF = "sensor_msgs/msg/Image", "tf2_msgs/msg/TFMessage"
DEPTH = np.full((24, 32), 1000, "<u2")
Clock = Callable[[int], int]


def refs(stamps: list[int], logs: list[int]) -> References:
    zero = np.zeros(len(stamps), np.int64)
    return References(np.array(stamps, np.int64), np.array(logs, np.int64), zero, zero, zero)


@pytest.mark.parametrize(
    ("late", "taken_out"), [(0, 0), (25 * MS, 0), (NS, 0), (NS + 1, NS + 1), (-1, -1)]
)  # fmt: skip
def test_clock_offsets_below_0_or_above_a_second_are_taken_out(late: int, taken_out: int) -> None:
    assert clock_offset_ns(refs([10, 20, 30], [10 + late + 5, 20 + late, 30 + late + 7])) == taken_out


@settings(derandomize=True, max_examples=100, deadline=None)
@given(
    passes=st.lists(st.integers(3, 40), min_size=1, max_size=5),
    step_ms=st.integers(20, 100),
    garbage=st.lists(st.integers(0, 10**6), max_size=3),
)
def test_resets_are_found_whatever_else_is_garbage(passes: list[int], step_ms: int, garbage: list[int]) -> None:
    """Passes over stamps from 0 on; single garbage stamps, far from each other, are no resets."""
    stamps = [k * step_ms * MS for n in passes for k in range(n)]
    starts = np.cumsum(passes)[:-1]
    expected = [
        int(i) for i, n in zip(starts, passes, strict=False)
        if (n - 3) * step_ms * MS - 2 * step_ms * MS > NS
    ]  # fmt: skip
    logs = list(range(len(stamps)))
    assert [r.log_ns for r in find_resets(np.array(stamps), np.array(logs))] == expected
    if len(passes) == 1:
        for at in {g % len(stamps) for g in garbage[:1]}:
            stamps[at] = 4_000_000_000 * NS
        assert find_resets(np.array(stamps), np.array(logs)) == ()


def test_order_in_the_file_is_no_reset() -> None:
    """Two files of one recording, the second read first."""
    stamps = np.r_[np.arange(50, 100), np.arange(50)] * 100 * MS
    assert find_resets(stamps, stamps + 5) == ()


def record(
    path: Path, *, color: Clock, depth: Clock | None = None, labels: Clock | None = None, log_of: Clock | None = None,
    frames: int = 40,
) -> Path:  # fmt: skip
    """10 Hz colour from BASE_NS on, 5 ms late; each channel's stamp is a function of the true time."""
    log = Recorder(path)
    for i in range(frames):
        true = BASE_NS + i * 100 * MS
        at = (log_of(true) if log_of else true) + 5 * MS
        log.ros("/cam/color", IMAGE, ROS.image(color(true), picture(i), "rgb8"), at)
        if depth:
            log.ros("/cam/depth", IMAGE, ROS.image(depth(true), DEPTH, "16UC1"), at + 1)
        if labels:
            log.ros("/cam/labels", IMAGE, ROS.image(labels(true), label_picture(i), "mono8"), at + 2)
        log.ros("/tf", TF, ROS.tf(color(true), [("world", "camera", (0.0, i / 10, 0.0), LEVEL)]), at + 3)
    if labels:
        log.ros("/cam/info", "vision_msgs/msg/LabelInfo", ROS.label_info(BASE_NS, {0: "a", 1: "b", 2: "c"}), BASE_NS)
    return log.close()


def true(ns: int) -> int:
    return ns


def opened(path: Path) -> tuple[list[tuple[bool, bool]], tuple[str, ...]]:
    """((has depth, has truth) of every frame, warnings)."""
    with open_log([path]) as log:
        return [(plan.depth_log_ns is not None, plan.has_truth) for plan in log.plans], log.info.warnings


def test_a_clean_log_has_nothing_to_say(tmp_path: Path) -> None:
    frames, warnings = opened(record(tmp_path / "log.mcap", color=true, depth=true, labels=true))
    assert frames == [(True, True)] * 40
    assert warnings == ()


@pytest.mark.parametrize(
    "clock",
    [lambda t: t - BASE_NS + 20 * MS, lambda t: t + 440_000_000 * NS, lambda t: t - BASE_NS + 86_400 * NS],
    ids=["simulated", "year 2037", "uptime"],
)
def test_all_on_a_clock_of_their_own(tmp_path: Path, clock: Clock) -> None:
    """Stamps only meet stamps: the frames are the same, the offsets are taken out of the log times and said."""
    frames, warnings = opened(record(tmp_path / "log.mcap", color=clock, depth=clock, labels=clock))
    assert frames == [(True, True)] * 40
    assert len(warnings) == 4
    assert all("taken out" in warning for warning in warnings)


def test_a_clock_that_is_set_back_is_refused(tmp_path: Path) -> None:
    """A simulation that was restarted while it was recorded: stamps count from 0 twice."""
    half = BASE_NS + 2000 * MS
    path = record(tmp_path / "log.mcap", color=lambda t: t - BASE_NS + NS if t < half else t - half + NS)
    with pytest.raises(LogError) as caught:
        open_log([path])
    assert str(caught.value) == (
        f"The clock of /cam/color was set back by 1.900 s at log time {half + 5 * MS} ns, so its stamps come twice; "
        "cut the log there, for example with mcap filter, and give the parts one by one."
    )


def test_depth_whose_clock_is_set_back_is_said(tmp_path: Path) -> None:
    half = BASE_NS + 2000 * MS
    path = record(tmp_path / "log.mcap", color=true, depth=lambda t: t if t < half else t - 2000 * MS)
    frames, warnings = opened(path)
    assert len(frames) == 40
    assert any("The clock of /cam/depth was set back by 1.900 s" in warning for warning in warnings)


def test_depth_on_another_clock_is_said_with_the_figure(tmp_path: Path) -> None:
    frames, warnings = opened(record(tmp_path / "log.mcap", color=true, depth=lambda t: t - 35 * MS))
    assert frames == [(False, False)] * 40
    assert warnings == (
        "The stamps of /cam/depth lie evenly 35.0 ms before the nearest colour stamps, more than the 20.0 ms that a "
        "pair may be apart: one of the clocks is off, and pairs are lost.",
    )
    frames, warnings = opened(record(tmp_path / "far.mcap", color=true, depth=lambda t: t - BASE_NS + NS))
    assert frames == [(False, False)] * 40
    assert f"on a clock that differs by about -{BASE_NS // NS - 1}.000 s: no frame has any of them" in warnings[-1]
    near = record(tmp_path / "near.mcap", color=true, depth=lambda t: t + 15 * MS, log_of=lambda t: t + 30 * MS)
    assert opened(near) == ([(True, False)] * 40, ())


def test_repeated_stamps_and_gaps_are_said(tmp_path: Path) -> None:
    """Two images of one stamp are two frames; a camera that was off leaves a gap."""

    def color(t: int) -> int:
        i = (t - BASE_NS) // (100 * MS)
        return t - 100 * MS if i == 7 else t + 3000 * MS if i >= 20 else t

    frames, warnings = opened(record(tmp_path / "log.mcap", color=color, log_of=lambda t: color(t) + MS))
    assert len(frames) == 40
    assert "1 images of /cam/color have the stamp of another one; each is a frame." in warnings
    assert "/cam/color has a gap of 3.100 s at t = 1.900 s." in warnings


def test_stamps_of_a_mixed_nature(tmp_path: Path) -> None:
    """Some of the stamps are zero: their log time counts; on a simulated clock that is far off, and said."""
    path = record(tmp_path / "log.mcap", color=lambda t: 0 if t % (300 * MS) == 0 else t)
    frames, warnings = opened(path)
    assert len(frames) == 40
    unstamped = sum(1 for i in range(40) if (BASE_NS + i * 100 * MS) % (300 * MS) == 0)
    assert f"{unstamped} of 40 messages on /cam/color have no capture stamp: their log time is used." in warnings
    path = record(tmp_path / "far.mcap", color=lambda t: 0 if t == BASE_NS + 100 * MS else t - BASE_NS + NS)
    frames, warnings = opened(path)
    assert len(frames) == 40
    assert any(
        "1 of 40 messages on /cam/color have no capture stamp: their log time is used, which is 1699999999.005 s off"
        in warning for warning in warnings
    )  # fmt: skip


def test_truth_that_comes_late_or_without_stamps(tmp_path: Path) -> None:
    """Labels that are all logged behind the recording still meet their images."""
    log = Recorder(tmp_path / "late.mcap")
    for i in range(20):
        stamp = BASE_NS + i * 100 * MS
        log.ros("/cam", IMAGE, ROS.image(stamp, picture(i), "rgb8"), stamp + 5 * MS)
    for i in range(0, 20, 5):
        labels = ROS.image(BASE_NS + i * 100 * MS, label_picture(i), "mono8")
        log.ros("/labels", IMAGE, labels, BASE_NS + 600 * NS + i)
    log.ros("/names", "vision_msgs/msg/LabelInfo", ROS.label_info(BASE_NS, {0: "a", 1: "b", 2: "c"}), BASE_NS)
    with open_log([log.close()]) as opened_log:
        assert [plan.index for plan in opened_log.plans if plan.has_truth] == [0, 5, 10, 15]
        assert opened_log.truth(5)[1:].tolist() == label_picture(5)[1:].tolist()
    path = record(tmp_path / "bare.mcap", color=true, labels=lambda _: 0)
    frames, warnings = opened(path)
    assert frames == [(False, True)] * 40
    assert any("40 of 40 messages on /cam/labels have no capture stamp" in warning for warning in warnings)
