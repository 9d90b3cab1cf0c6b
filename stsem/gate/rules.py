"""What is allowed to change, and by how much: one row per gated metric."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from stsem.errors import UsageError

_ROUNDING = 1e-9
"""Slack for the rounding of a difference of two floats; far below anything that a limit can say."""

Kind = Literal["points", "percent", "none"]


@dataclass(frozen=True)
class Rule:
    """A metric may get worse by `limit` at most.

    Args:
        path: where the metric stands inside a run.
        name: for readers.
        kind: `points`: the limit is in percentage points of a fraction; `percent`: in per cent of the baseline's
            value; `none`: it may not get worse at all.
        limit: how much worse is accepted; 0 accepts nothing.
        higher_is_better: direction of good.
        timing: whether it depends on the cost profile.
    """

    path: str
    name: str
    kind: Kind
    limit: float
    higher_is_better: bool
    timing: bool

    def change(self, base: float, head: float) -> float:
        """How much better `head` is, in points, per cent or units; negative is worse."""
        better = head - base if self.higher_is_better else base - head
        if self.kind == "points":
            return 100 * better
        if self.kind == "percent":
            return 100 * better / abs(base) if base else (0.0 if not better else float("inf") * better)
        return better

    def broken(self, base: float, head: float) -> str | None:
        """The sentence that says how the rule is broken; None when it holds."""
        worse = -self.change(base, head)
        if worse <= self.limit + _ROUNDING:
            return None
        direction = "fell" if self.higher_is_better else "rose"
        by = {"points": f"{worse:.2f} points", "percent": f"{worse:.1f} %", "none": f"{worse:g}"}[self.kind]
        allowed = {"points": f"{self.limit:g} points", "percent": f"{self.limit:g} %", "none": "nothing"}[self.kind]
        return f"{self.name} {direction} by {by}; {allowed} is allowed"


def _score(name: str, timing: bool) -> tuple[Rule, ...]:
    return (
        Rule(f"{name}.miou", f"{name} mIoU", "points", 0.5, True, timing),
        Rule(f"{name}.pixel_accuracy", f"{name} pixel accuracy", "points", 0.5, True, timing),
    )


RULES = (
    *_score("offline", timing=False),
    *_score("delivered", timing=True),
    *_score("streaming", timing=True),
    Rule("coverage.scored", "scored frames", "none", 0.0, True, timing=False),
    Rule("latency_ms.from_arrival.p95", "latency p95", "percent", 5.0, False, timing=True),
    Rule("latency_ms.from_arrival.max", "latency max", "percent", 5.0, False, timing=True),
    Rule("throughput.output_hz", "output rate", "percent", 5.0, True, timing=True),
)


@dataclass(frozen=True)
class Limits:
    """What a gate asks for.

    Args:
        rules: one per gated metric.
        timing: whether what depends on the cost profile is gated; without it, only the offline scores are.
        exact: whether results and outcomes must be equal; None: exactly when the oracle made both reports.
    """

    rules: tuple[Rule, ...] = field(default=RULES)
    timing: bool = True
    exact: bool | None = None

    @property
    def active(self) -> tuple[Rule, ...]:
        """The rules that are judged."""
        return tuple(rule for rule in self.rules if self.timing or not rule.timing)

    def with_limits(self, limits: Mapping[str, float]) -> "Limits":
        """These limits with some replaced, path -> limit in the rule's own kind.

        Raises:
            UsageError: no rule has that path, or a limit is negative or no number.
        """
        known = [rule.path for rule in self.rules]
        for path, limit in limits.items():
            if path not in known:
                near = difflib.get_close_matches(path, known, n=1, cutoff=0.0)
                raise UsageError(f"There is no gate for {path!r}; the nearest is {near[0]!r}.")
            if not limit >= 0:
                raise UsageError(f"The limit of {path} is {limit:g}; a number of at least 0 was expected.")
        return replace(self, rules=tuple(replace(rule, limit=limits.get(rule.path, rule.limit)) for rule in self.rules))
