"""Keyframes up to a rate, spent where prediction would lose most."""

from stsem.stages.candidate import Candidate, Motion

BURST = 3
"""Keyframes that can be saved up."""
WEIGHT = 0.25
"""Of the newest choice in the mean of losses."""


class BudgetPolicy:
    """At most `hz` keyframes a second of capture time: in t seconds at most `burst` + hz t, wherever they begin.

    A token bucket: a keyframe costs a token, `hz` of them come in every second, `burst` fit in. Whoever has one spends
    it on a frame that loses more than the frames chosen before did on average; the more are saved up, the less a frame
    has to lose, and from `burst` - 1 on the next one is chosen whatever it shows. So the budget is spent: in t seconds
    all but `burst` of hz t keyframes, if frames come faster than tokens and can be segmented. Looks neither ahead nor
    at labels.

    Args:
        hz: keyframes a second, above 0.
        by_coverage: whether the loss is what keyframes do not cover; else it is how far the image moved.
        burst: at least 2.
    """

    def __init__(self, hz: float, *, by_coverage: bool, burst: int = BURST) -> None:
        self._price_ns, self._by_coverage, self._burst = max(1, round(1e9 / hz)), by_coverage, burst
        self._saved_ns = 0
        self._asked_ns: int | None = None
        self._usual = 0.0

    @property
    def needs_homography(self) -> bool:
        """Where the loss is motion."""
        return not self._by_coverage

    @property
    def needs_coverage(self) -> bool:
        """Where the loss is what is not covered."""
        return self._by_coverage

    def reason(self, candidate: Candidate) -> str | None:
        """`budget`, or None."""
        self._save(candidate)
        loss = self._loss(candidate)
        if self._saved_ns < self._price_ns:
            return None
        if (patience := self._patience) > 0 and loss <= self._usual * patience:
            return None
        self._saved_ns -= self._price_ns
        self._usual += WEIGHT * (loss - self._usual)
        return "budget"

    def _save(self, candidate: Candidate) -> None:
        """Tokens that came in since the last frame, or since the first keyframe, which took the one there was."""
        since = candidate.stamp_ns - candidate.elapsed_ns if self._asked_ns is None else self._asked_ns
        self._saved_ns = min(self._burst * self._price_ns, self._saved_ns + candidate.stamp_ns - since)
        self._asked_ns = candidate.stamp_ns

    @property
    def _patience(self) -> float:
        """From 1 with one token to 0 with `burst` - 1 of them or more."""
        full = (self._burst - 1) * self._price_ns
        return max(0.0, (full - self._saved_ns) / max(1, full - self._price_ns))

    def _loss(self, candidate: Candidate) -> float:
        """0 for an image like the keyframe's to 1 for one that nothing is known about."""
        if self._by_coverage:
            return 1.0 if candidate.coverage is None else 1.0 - candidate.coverage
        return 1.0 if candidate.motion is None else _moved(candidate.motion)


def _moved(motion: Motion) -> float:
    return min(1.0, motion.rotation + motion.translation)
