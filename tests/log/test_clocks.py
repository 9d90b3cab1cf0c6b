"""Clocks and stamps: what is taken out, what is refused, what is said; small logs whose clocks misbehave."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_logs import BASE_NS, LEVEL, NS, ROS, Recorder, label_picture, picture

from stsem.errors import LogError
from stsem.log.clocks import clock_offset_ns, find_resets, find_resets_in_file
from stsem.log.log import open_log
from stsem.log.tracks import References
from stsem.log.unstamped import FROM_ZERO, LOG_TIMES, stand_in
from stsem.packed import ABSENT

MS = 1_000_000
IMAGE, TF = "sensor_msgs/msg/Image", "tf2_msgs/msg/TFMessage"
DEPTH = np.full((24, 32), 1000, "<u2")
Clock = Callable[[int], int]
Rows = npt.NDArray[np.int64]


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
    few = len(starts) <= max(1, (len(stamps) - 1) / 10)
    expected = [
        int(i) for i, n in zip(starts, passes, strict=False)
        if (n - 3) * step_ms - 2 * step_ms > 1000 or (few and (n - 1) * step_ms > max(100, 2 * step_ms))
    ]  # fmt: skip
    logs = list(range(len(stamps)))
    assert [r.log_ns for r in find_resets(np.array(stamps), np.array(logs))] == expected
    if len(passes) == 1:
        for at in {g % len(stamps) for g in garbage[:1]}:
            stamps[at] = 4_000_000_000 * NS
        assert find_resets(np.array(stamps), np.array(logs)) == ()


PERIOD = 100 * MS
IN_ORDER = np.arange(100)
BLOCKS = IN_ORDER.reshape(10, 10)
ORDERS = {
    "halves": np.roll(IN_ORDER, 50),
    "reversed": IN_ORDER[::-1],
    "reversed blocks": BLOCKS[::-1].ravel(),
    "shuffled": np.random.default_rng(1).permutation(100),
    "shuffled blocks": BLOCKS[np.random.default_rng(2).permutation(10)].ravel(),
    "a late block": np.r_[0:20, 40:60, 20:40, 60:100],
    "a late block at the end": np.r_[0:60, 80:100, 60:80],
    "a late block of three": np.r_[0:20, 23:60, 20:23, 60:100],
    "one late image": np.r_[0:20, 21:60, 20, 60:100],
    "two writers": np.r_[0:40:2, 40:80:2, 1:41:2, 80:100:2, 41:100:2],
}


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS.keys())
def test_order_in_the_file_is_no_reset(order: Rows) -> None:
    """Messages that changed places, with the jitter and the drops of a real camera."""
    jitter = np.random.default_rng(3).integers(-10, 10, 100) * MS
    for kept in (order, order[order % 7 != 3]):
        stamps = kept * PERIOD + jitter[kept] + BASE_NS
        assert find_resets(stamps, stamps + 5) == ()
        assert find_resets_in_file(stamps, stamps + 5) == ()


@settings(derandomize=True, max_examples=100, deadline=None)
@given(
    before=st.integers(4, 60), behind=st.integers(4, 60), back_ms=st.integers(310, 3_600_000), period_ms=st.just(100)
)
def test_a_clock_that_is_set_back_with_the_recorders(before: int, behind: int, back_ms: int, period_ms: int) -> None:
    """By whatever, except where the second pass ends just before the first begins, as halves do that changed places."""
    true = np.arange(before + behind) * period_ms * MS + BASE_NS
    stamps = true - back_ms * MS * (np.arange(before + behind) >= before)
    between_ms = back_ms - (before + behind - 1) * period_ms
    found = find_resets_in_file(stamps, stamps + 5)
    if -period_ms <= between_ms <= 1000:
        return
    (reset,) = found
    assert (reset.log_ns, reset.back_ns) == (stamps[before] + 5, (back_ms - period_ms) * MS)
    assert reset.twice_ns is not None
    since, until = reset.twice_ns
    assert (since > until) == (between_ms > 0)
    outside = (stamps + 5 < min(since, until + 1)) | (stamps + 5 > max(until, since - 1))
    inside_both = [((stamps + 5)[half] >= since) & ((stamps + 5)[half] <= until) for half in
                   (np.arange(len(stamps)) < before, np.arange(len(stamps)) >= before)]  # fmt: skip
    assert outside.any()
    assert all(half.any() for half in inside_both) == (since <= until)


def test_few_late_messages_are_no_reset() -> None:
    """One in twelve comes half a second late."""
    dozen = np.array([0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 5, 11])
    stamps = np.concatenate([12 * i + dozen for i in range(10)]) * PERIOD
    assert find_resets_in_file(stamps, stamps) == ()
    assert find_resets(stamps, np.arange(len(stamps))) == ()


STAND_INS = {
    "all there": ([1000, 1100], [1005, 1105], [1000, 1100], ""),
    "none there": ([None, None], [1005, 1105], [1005, 1105], LOG_TIMES),
    "few there": ([None, 1100, None], [1005, 1105, 1205], [1005, 1100, 1205], LOG_TIMES),
    "few missing": ([1000, None, 1200], [91005, 91105, 91205], [1000, 1100, 1200], "0.090 s is taken from"),
    "from zero": ([None, 100, 200], [91005, 91105, 91205], [0, 100, 200], FROM_ZERO),
    "slow from zero": ([None, 100, 200], [90005, 91105, 92205], [0, 100, 200], FROM_ZERO),
    "far from zero": ([None, 30000, 30100], [91005, 91105, 91205], [29900, 30000, 30100], "0.061 s is taken from"),
}


@pytest.mark.parametrize(("stamps", "logs", "expected", "words"), STAND_INS.values(), ids=STAND_INS.keys())
def test_what_stands_in_for_stamps(stamps: list[int | None], logs: list[int], expected: list[int], words: str) -> None:
    """In microseconds."""
    given_ns = np.array([ABSENT if stamp is None else stamp * 1000 for stamp in stamps])
    filled, said = stand_in(given_ns, np.array(logs) * 1000)
    assert (filled // 1000).tolist() == expected
    assert said.startswith(words)
    assert bool(said) == bool(words)


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
    uneven = record(tmp_path / "far.mcap", color=true, depth=lambda t: (t - BASE_NS) // 2 + NS)
    frames, warnings = opened(uneven)
    assert frames == [(False, False)] * 40
    assert "s: no frame has any of them" in warnings[-1]
    near = record(tmp_path / "near.mcap", color=true, depth=lambda t: t + 15 * MS, log_of=lambda t: t + 30 * MS)
    assert opened(near) == ([(True, False)] * 40, ())


def test_repeated_stamps_and_gaps_are_said(tmp_path: Path) -> None:
    """Two images of one stamp are two frames; a camera that was off leaves a gap."""

    def color(t: int) -> int:
        i = (t - BASE_NS) // (100 * MS)
        return t - 100 * MS if i == 7 else t + 3000 * MS if i >= 20 else t

    def hour_on(t: int) -> int:
        return t + 3600 * NS * (t >= BASE_NS + 20 * PERIOD)

    frames, warnings = opened(record(tmp_path / "log.mcap", color=color, log_of=lambda t: color(t) + MS))
    assert len(frames) == 40
    assert "1 images of /cam/color have the stamp of another one; each is a frame." in warnings
    assert (
        "/cam/color has a gap of 3.100 s at t = 1.900 s, as have the other channels: recording was paused, or the disk "
        "or the queue of the recorder held it up." in warnings
    )
    frames, warnings = opened(record(tmp_path / "forward.mcap", color=color))
    assert "t = 1.900 s, in 0.100 s of log time: its clock was set forward." in "".join(warnings)
    frames, warnings = opened(record(tmp_path / "hour.mcap", color=hour_on, log_of=hour_on))
    assert "recording was paused, or the clock was set forward." in "".join(warnings)


def test_stamps_of_a_mixed_nature(tmp_path: Path) -> None:
    """Some of the stamps are zero: as late as the others, whatever their clock; in front of all it is a stamp."""

    def stamps(name: str, color: Clock, **others: Clock) -> tuple[list[int], str]:
        with open_log([record(tmp_path / name, color=color, **others)]) as log:
            assert all(plan.depth_log_ns is not None for plan in log.plans)
            return [plan.stamp_ns for plan in log.plans], "".join(log.info.warnings)

    every = [BASE_NS + i * PERIOD for i in range(40)]
    found, said = stamps("a.mcap", lambda t: 0 if t % (3 * PERIOD) == 0 else t, depth=true)
    assert found == every
    assert "13 of 40 messages on /cam/color have no capture stamp: 0.005 s is taken from their log time, as" in said
    found, said = stamps(
        "b.mcap", lambda t: 0 if t == BASE_NS + PERIOD else t - BASE_NS + NS, depth=lambda t: t - BASE_NS + NS
    )
    assert found == [stamp - BASE_NS + NS for stamp in every]
    assert "1 of 40 messages on /cam/color have no capture stamp: 1699999999.005 s is taken from their log time" in said
    found, said = stamps("c.mcap", lambda t: t - BASE_NS, depth=lambda t: t - BASE_NS)
    assert found == [stamp - BASE_NS for stamp in every]
    assert "1 of 40 messages on /cam/depth have no capture stamp: their stamp is 0, where that clock begins." in said


@pytest.mark.parametrize("back_ms", [310, 500, 750, 3_600_000])
def test_a_recorder_whose_clock_is_set_back_is_refused(tmp_path: Path, back_ms: int) -> None:
    """Log times come twice with the stamps: the order of the file tells."""

    def clock(t: int) -> int:
        return t - back_ms * MS * (t >= BASE_NS + 20 * PERIOD)

    with pytest.raises(LogError) as caught:
        open_log([record(tmp_path / "both.mcap", color=clock, log_of=clock)])
    start, late = BASE_NS + 2000 * MS - back_ms * MS, 5 * MS
    cut = (
        f"cut the log at {BASE_NS + late} ns, for example with mcap filter, and give the parts one by one: the later "
        "one was recorded first." if back_ms > 10_000 else
        f"so log times from {start + late} to {BASE_NS + 1900 * MS + late} ns come twice; cut them out, for example "
        "with mcap filter, and give what is before and what is behind them one by one."
    )  # fmt: skip
    how = "and the recorder's with it; " if back_ms > 10_000 else "and the recorder's with it, "
    assert str(caught.value) == (
        f"The clock of /cam/color was set back by {back_ms / 1000 - 0.1:.3f} s at log time {start + late} ns, "
        f"{how}{cut}"
    )
    with pytest.raises(LogError, match="so its stamps come twice; cut the log there"):
        open_log([record(tmp_path / "stamps.mcap", color=clock)])


def test_depth_from_the_future_is_shifted(tmp_path: Path) -> None:
    """A depth camera whose clock is ahead by whole periods: without a word it would meet the wrong images."""
    path = record(tmp_path / "log.mcap", color=true, depth=lambda t: t + 400 * MS, labels=true)
    with open_log([path]) as log:
        rows = [(plan.color_log_ns, plan.depth_log_ns) for plan in log.plans]
        assert rows == [(BASE_NS + i * PERIOD + 5 * MS, BASE_NS + i * PERIOD + 5 * MS + 1) for i in range(40)]
        assert log.info.clock_offsets_ns == {}
        assert log.info.warnings == (
            "/cam/depth and /cam/color are on two clocks: log times are -0.395 s and 0.005 s behind their stamps or "
            "more; -0.400 s is added to the stamps of the first, to within what transport differs.",
        )


@pytest.mark.parametrize(
    ("color", "depth", "log_of", "words"),
    [
        (true, lambda t: t + 90 * MS, true, ""),
        (true, lambda t: t - 5007 * MS, true, "+5.007 s is added"),
        (true, lambda t: t - 1203 * MS, true, ""),
        (lambda t: t + 333 * MS, true, true, "so no pair can be trusted, and the first is not used."),
        (lambda t: t + 3 * NS, lambda t: t + 2850 * MS, true, ""),
        (true, true, lambda t: t + 5 * NS, ""),
        (true, lambda t: t + 400 * MS + (t // PERIOD) % 7 * 40 * MS, true, ""),
    ],
    ids=["little", "late", "late and met", "colour ahead", "both ahead", "recorder", "unsteady"],
)
def test_which_channels_are_shifted(tmp_path: Path, color: Clock, depth: Clock, log_of: Clock, words: str) -> None:
    """Only those that cannot be on the clock of colour."""
    frames, warnings = opened(record(tmp_path / "log.mcap", color=color, depth=depth, log_of=log_of))
    assert any("are on two clocks" in warning for warning in warnings) == bool(words)
    assert words in "".join(warnings)
    if "added" in words:
        assert frames == [(True, False)] * 40
    if "not used" in words:
        assert frames == [(False, False)] * 40


def test_depth_that_always_comes_late_is_said(tmp_path: Path) -> None:
    """A slow computation, or a clock that is behind: nothing tells, so nothing is shifted."""
    frames, warnings = opened(record(tmp_path / "a.mcap", color=true, depth=lambda t: t - 405 * MS))
    assert [depth for depth, _ in frames] == [True] * 36 + [False] * 4
    assert warnings == (
        "/cam/depth is logged 0.405 s later behind its stamps than /cam/color, evenly: if nothing computes for so "
        "long, its clock is behind, and pairs are of images that far apart.",
    )


def test_poses_from_the_future_are_said(tmp_path: Path) -> None:
    log = Recorder(tmp_path / "log.mcap")
    for i in range(40):
        at = BASE_NS + i * PERIOD
        log.ros("/cam/color", IMAGE, ROS.image(at, picture(i), "rgb8"), at + 5 * MS)
        log.ros("/tf", TF, ROS.tf(at + 300 * MS, [("world", "camera", (0.0, i / 10, 0.0), LEVEL)]), at + 6 * MS)
    _, warnings = opened(log.close())
    assert "taken out; unless poses are dated ahead on purpose, they are that far off the images." in warnings[-1]


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
