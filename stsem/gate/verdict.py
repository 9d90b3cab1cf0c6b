"""A verdict: one object that the exit code, the sentence, the table and the file are all read from."""

from typing import Literal

from stsem.document.part import Number, Part
from stsem.errors import EXIT_FINE, EXIT_GATE_FAILED, EXIT_LOSSY, EXIT_NOTHING_MEASURED

GateState = Literal["passed", "failed", "not comparable", "nothing measured"]
Mark = Literal["ok", "better", "worse", "missing", "new"]


class Check(Part):
    """One rule applied to one metric of one run."""

    mode: str
    """The run."""
    metric: str
    """Path inside the run, or `outcomes`, `results`."""
    name: str
    """The metric for readers."""
    base: Number = None
    """The baseline's value, in the unit of report.json."""
    head: Number = None
    """The judged report's value."""
    change: Number = None
    """How much better, in `unit`; negative is worse."""
    limit: Number = None
    """How much worse is allowed, in `unit`."""
    unit: str = ""
    """`points`, `%`, or empty for equality."""
    mark: Mark
    """`ok`, `better` (by more than the limit), `worse` (the rule is broken), `missing`, or `new` (not gated)."""
    text: str = ""
    """The sentence, when the rule is broken or the metric is missing."""

    @property
    def strain(self) -> float:
        """Worsening as a share of the limit: the largest is the worst number; 0 when nothing got worse."""
        if self.change is None or self.change >= 0:
            return 0.0
        return -self.change / self.limit if self.limit else float("inf")


class GateVerdict(Part):
    """What a gate decided, and why."""

    state: GateState
    """`passed`, `failed`, `not comparable` or `nothing measured`."""
    exit_code: int
    """Exit code of the command: 0 passed, 3 passed on a lossy input, 4 failed, 5 nothing to judge."""
    headline: str
    """The worst number; a second sentence when the two computed in another precision or by another backend."""
    reasons: tuple[str, ...] = ()
    """Why it failed or could not be judged, one sentence each."""
    checks: tuple[Check, ...] = ()
    """Every rule that was applied."""
    environment: tuple[str, ...] = ()
    """What differs between the two installations."""
    base_digest: str = ""
    """Digest of the report behind the baseline."""
    head_digest: str = ""
    """Digest of the judged report."""
    log: str = ""
    """Names of the logs."""

    def count(self, mark: Mark) -> int:
        """How many checks have this mark."""
        return sum(check.mark == mark for check in self.checks)


def exit_code(state: GateState, lossy: bool) -> int:
    """The exit code of DESIGN 6."""
    if state == "failed":
        return EXIT_GATE_FAILED
    if state != "passed":
        return EXIT_NOTHING_MEASURED
    return EXIT_LOSSY if lossy else EXIT_FINE
