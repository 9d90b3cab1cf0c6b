"""The keyframe rules at, just below and just above their thresholds."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.errors import UsageError
from stsem.geometry.homography import Homography
from stsem.stages.budget import BudgetPolicy
from stsem.stages.candidate import Candidate, KeyframePolicy, Motion
from stsem.stages.select import SHARE, CoveragePolicy, EveryPolicy, PaperPolicy, parse_policy

MS = 10**6
PAPER = PaperPolicy(rotation=0.1, translation=0.15, time_ns=1_000_000_000)


def candidate(*, elapsed_ns: int = 0, rotation: float = 0.0, translation: float = 0.0) -> Candidate:
    return Candidate(7, 0, 3, elapsed_ns, Motion(rotation, translation))


@pytest.mark.parametrize(
    ("field", "threshold", "reason"), [("rotation", 0.1, "rotation"), ("translation", 0.15, "translation")]
)
def test_each_threshold(field: str, threshold: float, reason: str) -> None:
    """The threshold itself is still near; the next number above is not."""
    assert PAPER.reason(candidate(**{field: math.nextafter(threshold, 0)})) is None  # type: ignore[arg-type]
    assert PAPER.reason(candidate(**{field: threshold})) is None  # type: ignore[arg-type]
    assert PAPER.reason(candidate(**{field: math.nextafter(threshold, 1)})) == reason  # type: ignore[arg-type]


def test_the_time_threshold() -> None:
    """To the nanosecond."""
    assert PAPER.reason(candidate(elapsed_ns=999_999_999)) is None
    assert PAPER.reason(candidate(elapsed_ns=1_000_000_000)) is None
    assert PAPER.reason(candidate(elapsed_ns=1_000_000_001)) == "time"


def test_the_order_of_reasons() -> None:
    """Time, no homography, rotation, translation: the first that holds is the reason."""
    late = 2_000_000_000
    assert PAPER.reason(candidate(elapsed_ns=late, rotation=1, translation=1)) == "time"
    assert PAPER.reason(Candidate(7, 0, 3, late, None)) == "time"
    assert PAPER.reason(Candidate(7, 0, 3, 0, None)) == "no homography"
    assert PAPER.reason(candidate(rotation=1, translation=1)) == "rotation"
    assert PAPER.reason(candidate(translation=1)) == "translation"


@given(
    rotation=st.floats(0, 10), translation=st.floats(0, 10), elapsed=st.integers(0, 10**10),
    limits=st.tuples(st.floats(0.001, 5), st.floats(0.001, 5), st.integers(1, 10**10)),
)  # fmt: skip
def test_a_keyframe_iff_a_term_exceeds(
    rotation: float, translation: float, elapsed: int, limits: tuple[float, float, int]
) -> None:
    """The rule as the paper has it, for any numbers."""
    reason = PaperPolicy(*limits).reason(candidate(elapsed_ns=elapsed, rotation=rotation, translation=translation))
    assert (reason is not None) == (rotation > limits[0] or translation > limits[1] or elapsed > limits[2])


def test_every_n_counts_log_indices() -> None:
    """Frames that were dropped in between count: the distance in the log decides, not the number of looks."""
    policy = EveryPolicy(5)
    assert [i for i in range(4, 12) if policy.reason(Candidate(i, 0, 3, 0, None))] == [8, 9, 10, 11]
    last, chosen = 0, []
    for index in (1, 2, 4, 7, 8, 13, 14, 17, 18, 30):
        if policy.reason(Candidate(index, 0, last, 0, None)):
            last = index
            chosen.append(index)
    assert chosen == [7, 13, 18, 30]


@pytest.mark.parametrize(
    ("width", "height", "shift"), [(640, 480, (64.0, 0.0)), (64, 480, (6.4, 0.0)), (100, 50, (-6.0, 8.0))]
)
def test_translation_is_in_image_widths(width: int, height: int, shift: tuple[float, float]) -> None:
    """A tenth of the width is 0.1 at every size and aspect; a shift has no rotation term."""
    H = np.array([[1, 0, shift[0]], [0, 1, shift[1]], [0, 0, 1]], np.float64)
    motion = Motion.of(Homography(H, 100, 100), (width, height))
    assert motion.translation == pytest.approx(0.1, rel=1e-12)
    assert motion.rotation == pytest.approx(0.0, abs=1e-12)


def test_rotation_about_the_centre() -> None:
    """An image turned in place has |R - I|_F = 2 sqrt(2) sin(a / 2) and no translation; the identity has neither."""
    width, height, angle = 640, 480, 0.05
    c, s = math.cos(angle), math.sin(angle)
    to_centre = np.array([[1, 0, -(width - 1) / 2], [0, 1, -(height - 1) / 2], [0, 0, 1]])
    H = np.linalg.inv(to_centre) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ to_centre
    motion = Motion.of(Homography(H, 100, 100), (width, height))
    assert motion.rotation == pytest.approx(2 * math.sqrt(2) * math.sin(angle / 2), rel=1e-9)
    assert motion.translation == pytest.approx(0.0, abs=1e-12)
    still = Motion.of(Homography(np.eye(3), 100, 100), (width, height))
    assert (still.rotation, still.translation) == (pytest.approx(0, abs=1e-15), pytest.approx(0, abs=1e-15))


def covered(index: int, share: float | None, *, last: int = 0) -> Candidate:
    """A frame of a 10 Hz log."""
    return Candidate(index, index * 100 * MS, last, (index - last) * 100 * MS, None, share)


def chosen(policy: KeyframePolicy, shares: list[float], *, gap: int = 1) -> list[int]:
    """Indices that become keyframes of a log whose frames lose `shares` of their coverage since the last keyframe."""
    found, left = [0], 1.0
    for i, share in enumerate(shares, start=1):
        left *= 1 - share
        if policy.reason(covered(i * gap, left, last=found[-1])):
            found.append(i * gap)
            left = 1.0
    return found


@given(share=st.floats(0.01, 1), least=st.floats(0.01, 1))
def test_coverage_is_monotone(share: float, least: float) -> None:
    """A keyframe exactly below the share; a frame that is covered less, or a policy that asks for more, is one too."""
    policy = CoveragePolicy(least, 10**9)
    assert (policy.reason(covered(1, share)) == "coverage") == (share < least)
    if policy.reason(covered(1, share)):
        assert policy.reason(covered(1, share / 2)) == "coverage"
        assert CoveragePolicy(min(1.0, least * 1.5), 10**9).reason(covered(1, share)) == "coverage"


def test_coverage_ends_with_time() -> None:
    """However much is covered; a method that cannot tell leaves the time alone."""
    policy = CoveragePolicy(0.5, 1000 * MS)
    assert [policy.reason(covered(i, 1.0)) for i in (9, 10, 11)] == [None, None, "time"]
    assert [policy.reason(covered(i, None)) for i in (9, 10, 11)] == [None, None, "time"]
    assert policy.reason(covered(11, 0.1)) == "time"


@settings(max_examples=150)
@given(
    hz=st.floats(0.2, 20), losses=st.lists(st.floats(0, 1), min_size=1, max_size=80), gap=st.integers(1, 4),
    burst=st.integers(2, 5),
)  # fmt: skip
def test_a_budget_is_kept_in_every_window(hz: float, losses: list[float], gap: int, burst: int) -> None:
    """At most the burst and what came in since, from any keyframe to any other; and all but the burst is spent."""
    found = chosen(BudgetPolicy(hz, by_coverage=True, burst=burst), losses, gap=gap)
    for i, first in enumerate(found):
        for j, last in enumerate(found[i:], start=1):
            assert j <= burst + hz * (last - first) * 0.1 + 1e-6
    if hz * gap * 0.1 <= 1:
        assert len(found) >= hz * len(losses) * gap * 0.1 - burst


def test_a_budget_is_spent_where_most_is_lost() -> None:
    """One keyframe a second: still, then a turn, then still. The turn gets what was saved, and all it can pay."""
    still, turn = [0.0] * 40, [0.2] * 20
    found = chosen(BudgetPolicy(1.0, by_coverage=True), still + turn + still)
    during = [i for i in found if 40 < i <= 60]
    assert len(during) == 3
    assert len(found) <= 11
    assert found == chosen(BudgetPolicy(1.0, by_coverage=True), still + turn + still)


def test_a_budget_by_motion() -> None:
    """Where nobody knows the coverage: the further the image moved, the sooner; no homography is the worst."""
    policy = BudgetPolicy(1.0, by_coverage=False)
    assert (policy.needs_homography, policy.needs_coverage) == (True, False)

    def reason(index: int, last: int, motion: Motion | None) -> str | None:
        return policy.reason(Candidate(index, index * 100 * MS, last, (index - last) * 100 * MS, motion))

    assert [reason(i, 0, Motion(0.1, 0.1)) for i in (9, 10)] == [None, "budget"]
    assert reason(11, 10, None) is None
    assert [reason(i, 10, Motion(0.0, 0.01)) for i in (20, 21)] == [None, None]
    assert reason(22, 10, None) == "budget"


def test_parsing() -> None:
    """What is spelled right becomes a policy with the numbers given; the rest is refused with the valid forms."""
    numbers = {"rotation": 1.0, "translation": 2.0, "time_ns": 3}
    assert parse_policy("paper", **numbers) == PaperPolicy(1.0, 2.0, 3)  # type: ignore[arg-type]
    assert parse_policy("every:12", **numbers) == EveryPolicy(12)  # type: ignore[arg-type]
    assert parse_policy("coverage", **numbers) == CoveragePolicy(SHARE, 3)  # type: ignore[arg-type]
    assert parse_policy("coverage:0.75", **numbers) == CoveragePolicy(0.75, 3)  # type: ignore[arg-type]
    for covers in (True, False):
        budget = parse_policy("budget:2.5", **numbers, covers=covers)  # type: ignore[arg-type]
        assert isinstance(budget, BudgetPolicy)
        assert (budget.needs_coverage, budget.needs_homography) == (covers, not covers)
    for text in (
        "", "paper:1", "paper:", "every", "every:", "every:0", "every:-1", "every:1.5", "every:٣", "every: 3", "PAPER",
        "coverage:", "coverage:0", "coverage:1.1", "coverage:nan", "coverage:1e-1", "coverage:1_0", "budget", "budget:",
        "budget:0", "budget:inf", "budget:-1", "budget:2000", "budget: 1",
    ):  # fmt: skip
        with pytest.raises(UsageError, match=r"every:N, coverage:SHARE, budget:HZ"):
            parse_policy(text, **numbers)  # type: ignore[arg-type]
