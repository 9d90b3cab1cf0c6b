"""The keyframe rules at, just below and just above their thresholds."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stsem.errors import UsageError
from stsem.geometry.homography import Homography
from stsem.stages.select import Candidate, EveryPolicy, Motion, PaperPolicy, parse_policy

PAPER = PaperPolicy(rotation=0.1, translation=0.15, time_ns=1_000_000_000)


def candidate(*, elapsed_ns: int = 0, rotation: float = 0.0, translation: float = 0.0) -> Candidate:
    return Candidate(7, 3, elapsed_ns, Motion(rotation, translation))


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
    assert PAPER.reason(Candidate(7, 3, late, None)) == "time"
    assert PAPER.reason(Candidate(7, 3, 0, None)) == "no homography"
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
    assert [i for i in range(4, 12) if policy.reason(Candidate(i, 3, 0, None))] == [8, 9, 10, 11]
    last, chosen = 0, []
    for index in (1, 2, 4, 7, 8, 13, 14, 17, 18, 30):
        if policy.reason(Candidate(index, last, 0, None)):
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


def test_parsing() -> None:
    """What is spelled right becomes a policy with the numbers given; the rest is refused with the valid forms."""
    assert parse_policy("paper", rotation=1.0, translation=2.0, time_ns=3) == PaperPolicy(1.0, 2.0, 3)
    assert parse_policy("every:12", rotation=1.0, translation=2.0, time_ns=3) == EveryPolicy(12)
    for text in ("", "paper:1", "every", "every:", "every:0", "every:-1", "every:1.5", "every:٣", "every: 3", "PAPER"):
        with pytest.raises(UsageError, match=r"every:N"):
            parse_policy(text, rotation=1.0, translation=2.0, time_ns=3)
