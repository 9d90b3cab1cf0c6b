"""When each frame arrives on the simulated clock."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from struct import Struct

from stsem.log.plan import FramePlan
from stsem.packed import Codes, Packed


@dataclass(frozen=True, slots=True)
class Slot:
    """One frame on the simulated clock.

    Args:
        index: log index.
        log_stamp_ns: capture stamp in the log.
        stamp_ns: simulated capture stamp; zero for the first frame.
        arrival_ns: simulated arrival.
        missing: needed channels without a message for this frame, by role.
        has_truth: whether truth exists for it.
    """

    index: int
    log_stamp_ns: int
    stamp_ns: int
    arrival_ns: int
    missing: tuple[str, ...]
    has_truth: bool


class Slots(Packed[Slot]):
    """The frames of a log on the simulated clock, in 30 bytes each."""

    layout = Struct("<iqqqb?")

    def __init__(self) -> None:
        self._missing: Codes[tuple[str, ...]] = Codes()
        super().__init__()

    def _pack(self, item: Slot) -> tuple[int, ...]:
        missing = self._missing.code(item.missing)
        return item.index, item.log_stamp_ns, item.stamp_ns, item.arrival_ns, missing, item.has_truth

    def _unpack(
        self, index: int, log_stamp_ns: int, stamp_ns: int, arrival_ns: int, missing: int, has_truth: bool
    ) -> Slot:
        return Slot(index, log_stamp_ns, stamp_ns, arrival_ns, self._missing.value(missing), has_truth)


def schedule(plans: Sequence[FramePlan], rate: Fraction, required: frozenset[str], optional: frozenset[str]) -> Slots:
    """DESIGN 3: sim_stamp = floor((stamp - stamp_0) / r), sim_arrival = sim_stamp + (arrival - stamp).

    Args:
        plans: every frame, in log order.
        rate: replay speed r.
        required: roles (`depth`, `pose`) without which a frame is incomplete.
        optional: roles that are waited for where they exist.
    """
    slots = Slots()
    if not plans:
        return slots
    first = plans[0].stamp_ns
    needs = required | optional
    for plan in plans:
        stamp = (plan.stamp_ns - first) * rate.denominator // rate.numerator
        arrival = stamp + plan.arrival_ns(needs) - plan.stamp_ns
        slots.append(Slot(plan.index, plan.stamp_ns, stamp, arrival, plan.missing(required), plan.has_truth))
    return slots


def watermarks(slots: Sequence[Slot]) -> Sequence[int]:
    """For each position: the earliest arrival among the later frames; one past everything for the last."""
    marks = array("q", bytes(8 * len(slots)))
    earliest = max((slot.arrival_ns for slot in slots), default=0) + 1
    for i in range(len(slots) - 1, -1, -1):
        marks[i] = earliest
        earliest = min(earliest, slots[i].arrival_ns)
    return marks


def horizon_ns(slots: Sequence[Slot], period_ns: int, rate: Fraction) -> int:
    """One median period (simulated) after the last arrival: what is unfinished then is pending."""
    last = max((slot.arrival_ns for slot in slots), default=0)
    return last + period_ns * rate.denominator // rate.numerator
