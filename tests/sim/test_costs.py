"""Cost sources: the draw of DESIGN 3, the fake, an earlier trace, and the stopwatch."""

import hashlib
from pathlib import Path

import pytest

from stsem.errors import CostError
from stsem.result import Span
from stsem.sim.costs import ConstantCosts, CostSource, MeasuredCosts, ProfileCosts, TraceCosts
from stsem.sim.profile import CostProfile
from stsem.sim.trace import RunTrace, read_durations, write_trace

PROFILE = CostProfile("m", {"segment@2": tuple(range(100, 150)), "segment@1": tuple(range(200, 250)), "fuse@1": (7,)})


def test_the_draw_is_the_hash_that_the_design_names() -> None:
    costs = ProfileCosts(PROFILE, seed=3, log_sha256="ab12")
    for stamp_ns in range(0, 5_000_000_000, 100_000_000):
        digest = hashlib.sha256(f"3\x1fab12\x1f{stamp_ns}\x1fsegment".encode()).digest()
        u = int.from_bytes(digest[:8], "big") / 2**64
        assert costs.cost_ns(stamp_ns, "segment", 2) == sorted(PROFILE.samples_ns["segment@2"])[int(u * 50)]


def test_modes_share_their_luck_and_the_order_of_calls_does_not_matter() -> None:
    forward = ProfileCosts(PROFILE, 0, "ab")
    backward = ProfileCosts(PROFILE, 0, "ab")
    stamps = range(50)
    one = [forward.cost_ns(stamp, "segment", 2) for stamp in stamps]
    other = [backward.cost_ns(stamp, "segment", 1) for stamp in reversed(stamps)]
    assert [cost + 100 for cost in one] == other[::-1]
    assert len(set(one)) > 20


def test_seed_log_and_stage_change_the_draw() -> None:
    def draws(seed: int, log: str) -> list[int]:
        return [ProfileCosts(PROFILE, seed, log).cost_ns(stamp, "segment", 2) for stamp in range(20)]

    assert len({tuple(draws(*key)) for key in [(0, "a"), (1, "a"), (0, "b")]}) == 3


def test_every_source_returns_the_result_with_its_cost() -> None:
    ticks = iter((10, 25))
    sources: list[tuple[CostSource, int]] = [
        (ProfileCosts(PROFILE, 0, "ab"), 7),
        (ConstantCosts({"fuse": 8}), 8),
        (TraceCosts({"keyframe": {(5, "fuse", 1): 9}}, "keyframe", "ff"), 9),
        (MeasuredCosts(lambda: next(ticks)), 15),
    ]
    for source, cost_ns in sources:
        assert source.run(5, "fuse", 1, lambda: "result") == ("result", cost_ns)


def test_an_unknown_stage_is_found_before_the_work_is_done() -> None:
    def work() -> None:
        raise AssertionError("must not run")

    for source in (ProfileCosts(PROFILE, 0, "ab"), ConstantCosts({"fuse": 8})):
        with pytest.raises(CostError, match="'track@1'"):
            source.run(5, "track", 1, work)


def test_constant_costs_may_depend_on_the_cores() -> None:
    costs = ConstantCosts({"segment": 10, "segment@2": 6})
    assert (costs.cost_ns("segment", 1), costs.cost_ns("segment", 2)) == (10, 6)
    assert costs.sha256 == ConstantCosts({"segment@2": 6, "segment": 10}).sha256
    assert costs.sha256 != ConstantCosts({"segment@2": 7, "segment": 10}).sha256


def test_an_earlier_trace_gives_back_its_exact_durations(tmp_path: Path) -> None:
    spans = [Span(0, "segment", (0, 1), 0, 0, 123_456_789_012_345_679), Span(1, "propagate", (1,), 5, 7, 8)]
    slow = [Span(0, "segment", (0, 1), 0, 0, 11)]
    stamps = {0: 1_700_000_000_000_000_001, 1: 1_700_000_000_100_000_001}
    path = tmp_path / "trace.json"
    write_trace(path, [RunTrace("keyframe", 2, stamps, spans), RunTrace("per-frame", 2, stamps, slow)])
    durations, sha256 = read_durations(path)
    costs = TraceCosts(durations, "keyframe", sha256)
    assert costs.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert costs.cost_ns(stamps[0], "segment", 2) == 123_456_789_012_345_679
    assert costs.cost_ns(stamps[1], "propagate", 1) == 1
    assert TraceCosts(durations, "per-frame", sha256).cost_ns(stamps[0], "segment", 2) == 11


def test_a_trace_knows_nothing_but_what_was_recorded() -> None:
    durations = {"keyframe": {(5, "segment", 2): 9}, "per-frame": {(5, "segment", 2): 9}}
    with pytest.raises(CostError, match=r"no 'segment@1' for the frame at 5 ns \(it has segment@2\)"):
        TraceCosts(durations, "keyframe", "").cost_ns(5, "segment", 1)
    with pytest.raises(CostError, match="no 'segment@2' for the frame at 6 ns"):
        TraceCosts(durations, "keyframe", "").cost_ns(6, "segment", 2)
    with pytest.raises(CostError, match="no jobs of the mode 'keyframe-async', only of keyframe, per-frame"):
        TraceCosts(durations, "keyframe-async", "")
