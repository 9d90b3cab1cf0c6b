"""`track` on the simulated clock: beside the answer path or on it, every frame, in log order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np
import pytest

from stsem.frame import Frame, Segmentation
from stsem.log.log import Loaded
from stsem.pose import Trajectory
from stsem.replay.answer import AnswerRule, Prediction
from stsem.replay.offline import OfflineRun
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, RealTimeRun
from stsem.replay.record import Record
from stsem.replay.schedule import Slot, horizon_ns
from stsem.replay.tracking import KnownPoses, posed
from stsem.result import Span
from stsem.sim.costs import ConstantCosts
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagation.method import Memoryless, Needs, Predicted
from stsem.stages.register import Registration
from stsem.stages.select import EveryPolicy
from stsem.stages.track import Tracking

from .conftest import MS, PERIOD_NS, NumberSegmenter, loaded, make_slots

COSTS = {"segment": 120 * MS, "propagate": 10 * MS, "track": 30 * MS, "decode": 5 * MS, "fuse": 7 * MS}


def at(index: int) -> Tracking:
    """The camera is `index` metres along x."""
    T_WC = np.eye(4)
    T_WC[0, 3] = index
    return Tracking(T_WC, T_WC, (0, T_WC))


@dataclass
class Numbers:
    """A tracker that notes in which order it is asked, and when each work is done."""

    prepared: list[int] = field(default_factory=list)
    worked: list[int] = field(default_factory=list)

    def prepare(self, frame: Frame) -> Callable[[], Tracking]:
        """Noted."""
        self.prepared.append(frame.index)

        def work() -> Tracking:
            self.worked.append(frame.index)
            return at(frame.index)

        return work

    def of(self, index: int) -> Tracking | None:
        """What was worked out."""
        return at(index) if index in self.worked else None


class Copy(Memoryless):
    """Predicts the keyframe's labels."""

    needs = Needs()

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """As they are."""
        return Predicted(source.segmentation, source.index)

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """Nobody asks."""
        return None


@dataclass
class Seen:
    """A segmenter and a map that note where the frames were that they got."""

    segmented: dict[int, float | None] = field(default_factory=dict)
    fused: dict[int, float] = field(default_factory=dict)

    def can_segment(self, index: int) -> bool:
        """Always."""
        return True

    def segment(self, frame: Frame) -> Segmentation:
        """Noted."""
        self.segmented[frame.index] = None if frame.T_WC is None else float(frame.T_WC[0, 3])
        return NumberSegmenter().segment(frame)

    def can_fuse(self, frame: Frame) -> bool:
        """With a pose."""
        return frame.T_WC is not None

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        """Noted."""
        assert frame.T_WC is not None
        self.fused[frame.index] = float(frame.T_WC[0, 3])


@dataclass
class Played:
    """A run that is over."""

    spans: Sequence[Span]
    tracker: Numbers
    seen: Seen
    record: Record

    def times(self, stage: str) -> list[tuple[int, float, float]]:
        """(frame, start, end) in ms of the jobs of a stage."""
        return [(span.frame, span.start_ns / MS, span.end_ns / MS) for span in self.spans if span.stage == stage]


def play(
    slots: Sequence[Slot], *, on_path: bool, every: int = 3, broken: frozenset[int] = frozenset(),
    count_decode: bool = False, costs: dict[str, int] = COSTS,
) -> Played:  # fmt: skip
    """One core for the network, mailbox of one."""
    tracker, seen = Numbers(), Seen()
    record = Record(slots, None, frozenset())
    rule = AnswerRule(seen, Prediction(EveryPolicy(every), Copy(), None))
    machine = Machine(
        2, 1, ConstantCosts(costs), Mailbox(*parse_queue("latest")), fuse=seen, count_decode=count_decode,
        tracker=tracker, pose_on_path=on_path,
    )  # fmt: skip
    run = RealTimeRun(slots, rule, machine, record)
    for slot in slots:
        whole = loaded(slot)
        run.push(Loaded(slot.index, None, None, None) if slot.index in broken else whole)
    run.finish(horizon_ns(slots, PERIOD_NS, Fraction(1)))
    record.results.sort(key=lambda result: result.index)
    return Played(run.spans, tracker, seen, record)


def test_beside_the_path_every_frame_is_tracked_and_no_answer_waits() -> None:
    """Frames arrive at 100 i + 10. Frame 0 is segmented 10-130 while 0 (10-40) and 1 (110-140) are tracked.

    It is fused 130-137, being older than frame 1, which is predicted then.
    """
    played = play(make_slots(4), on_path=False)
    assert played.times("segment") == [(0, 10, 130), (3, 310, 430)]
    assert played.times("propagate") == [(1, 137, 147), (2, 210, 220)]
    assert played.times("track") == [(0, 10, 40), (1, 110, 140), (2, 210, 240), (3, 310, 340)]
    assert played.seen.segmented == {0: None, 3: None}


def test_on_the_path_the_answer_waits_for_the_pose() -> None:
    """Frame 0: tracked 10-40, then segmented 40-160; frame 1 is tracked beside it, 110-140, and predicted at 160."""
    played = play(make_slots(4), on_path=True)
    assert played.times("track") == [(0, 10, 40), (1, 110, 140), (2, 210, 240), (3, 310, 340)]
    assert played.times("segment") == [(0, 40, 160), (3, 340, 460)]
    assert played.times("propagate") == [(1, 160, 170), (2, 240, 250)]
    assert played.seen.segmented == {0: 0.0, 3: 3.0}


@pytest.mark.parametrize("on_path", [False, True])
def test_dropped_frames_are_tracked_in_order_and_keyframes_fused_with_their_pose(on_path: bool) -> None:
    """The network takes three and a half periods: frames are dropped, and all that arrive are tracked."""
    played = play(make_slots(12), on_path=on_path, every=1, costs=COSTS | {"segment": 350 * MS})
    outcomes = [str(result.outcome) for result in played.record.results]
    assert outcomes.count("dropped_busy") >= 6
    assert played.tracker.worked == list(range(12))
    assert [frame for frame, _, _ in played.times("track")] == list(range(12))
    fused = played.seen.fused
    assert len(fused) >= 3
    assert all(x == index for index, x in fused.items())


def test_a_slow_tracker_falls_behind_and_loses_no_frame() -> None:
    """Tracking takes one and a half periods: frame i is tracked in i's turn, 10 + 150 i, and fused after that."""
    played = play(make_slots(8), on_path=False, costs=COSTS | {"track": 150 * MS})
    assert [(frame, start) for frame, start, _ in played.times("track")] == [(i, 10 + 150 * i) for i in range(6)]
    assert [frame for frame, _, _ in played.times("fuse")] == [0, 3]
    assert [start for _, start, _ in played.times("fuse")] == [160, 610]


def test_tracked_in_log_order_whatever_the_order_of_arrival() -> None:
    """Frame 1 arrives after frame 2, which waits for it; a frame without an image is passed over when it arrives."""
    slots = list(make_slots(5))
    slots[1] = replace(slots[1], arrival_ns=slots[2].arrival_ns + 45 * MS)
    played = play(slots, on_path=False, broken=frozenset({3}))
    assert played.tracker.worked == [0, 1, 2, 4]
    assert played.times("track") == [(0, 10, 40), (1, 255, 285), (2, 285, 315), (4, 410, 440)]


@pytest.mark.parametrize("on_path", [False, True])
def test_a_frame_is_decoded_once(on_path: bool) -> None:
    """Path and tracker need the same decoded frame."""
    played = play(make_slots(9), on_path=on_path, count_decode=True)
    assert sorted(frame for frame, _, _ in played.times("decode")) == list(range(9))
    decoded = {frame: end for frame, _, end in played.times("decode")}
    later = [span for span in played.spans if span.stage != "decode"]
    assert all(span.start_ns / MS >= decoded[span.frame] for span in later)


def test_offline_every_frame_is_tracked_even_those_that_nobody_scores() -> None:
    """`per-frame` computes only frames with truth; SLAM is given them all."""
    slots = [replace(slot, has_truth=slot.index % 3 == 0) for slot in make_slots(7)]
    tracker, seen = Numbers(), Seen()
    run = OfflineRun(
        slots, AnswerRule(seen, None), Record(slots, None, frozenset()), fuse=seen, only_truth=True, tracker=tracker
    )
    for slot in slots:
        run.push(loaded(slot))
    assert tracker.worked == list(range(7))
    assert seen.segmented == {0: 0.0, 3: 3.0, 6: 6.0}
    assert seen.fused == {0: 0.0, 3: 3.0, 6: 6.0}


def test_known_poses_stand_in_for_a_tracker() -> None:
    """At a frame's stamp, or none at all: nothing is interpolated."""
    slots = make_slots(3)
    T_WC = np.stack([np.eye(4), np.eye(4)])
    T_WC[1, 0, 3] = 5.0
    known = KnownPoses(Trajectory(np.array([slots[0].log_stamp_ns, slots[2].log_stamp_ns]), T_WC))
    found = [known.prepare(frame)() for slot in slots if (frame := loaded(slot).frame) is not None]
    assert [None if one.T_WC is None else one.T_WC[0, 3] for one in found] == [0.0, None, 5.0]
    assert known.of(2) is found[2]
    assert known.of(7) is None
    frame = loaded(slots[1]).frame
    assert frame is not None
    assert posed(frame, found[2]).T_WC is found[2].T_OC
