"""The core pool: who starts when, on which cores, and what everybody else can see."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise, permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.errors import UsageError
from stsem.result import Span
from stsem.sim.cores import CorePool, Job
from stsem.sim.events import EventQueue, Priority
from stsem.sim.trace import schedule_text

Request = tuple[int, int, str, int, int, int]
"""(ready, frame, stage, order, cores, cost)."""


def job(
    frame: int, stage: str, order: int, cores: int, cost_ns: int, then: Callable[[], None] = lambda: None
) -> Job[None]:
    return Job(frame, stage, order, cores, lambda: (None, cost_ns), lambda _: then())


def schedule(requests: list[Request], cores: int = 2) -> tuple[Span, ...]:
    queue = EventQueue()
    pool = CorePool(queue, cores)
    for ready, frame, stage, order, claimed, cost in requests:
        queue.schedule(ready, Priority.ARRIVAL, partial(pool.submit, job(frame, stage, order, claimed, cost)))
    queue.run()
    return tuple(pool.spans)


def test_jobs_of_one_instant_start_oldest_frame_first_then_in_pipeline_order() -> None:
    spans = schedule([(0, 2, "a", 0, 1, 5), (0, 1, "b", 1, 1, 5), (0, 1, "a", 0, 1, 5)])
    assert [(s.frame, s.stage, s.cores, s.start_ns) for s in spans] == [
        (1, "a", (0,), 0),
        (1, "b", (1,), 0),
        (2, "a", (0,), 5),
    ]


def test_a_waiting_two_core_job_holds_younger_ones_back_but_not_older_ones() -> None:
    spans = schedule([(0, 0, "a", 0, 1, 10), (1, 2, "wide", 0, 2, 4), (2, 3, "young", 0, 1, 1), (3, 1, "old", 0, 1, 2)])
    assert [(s.stage, s.cores, s.ready_ns, s.start_ns, s.end_ns) for s in spans] == [
        ("a", (0,), 0, 0, 10),
        ("old", (1,), 3, 3, 5),
        ("wide", (0, 1), 1, 10, 14),
        ("young", (0,), 2, 14, 15),
    ]


def test_a_finish_frees_its_core_for_an_arrival_of_the_same_instant() -> None:
    spans = schedule([(0, 0, "a", 0, 2, 5), (5, 1, "b", 0, 2, 5)])
    assert [(s.start_ns, s.end_ns) for s in spans] == [(0, 5), (5, 10)]


def test_a_follower_of_an_old_frame_goes_before_a_younger_arrival_of_the_same_instant() -> None:
    queue = EventQueue()
    pool = CorePool(queue, 1)
    pool.submit(job(0, "first", 0, 1, 5, then=lambda: pool.submit(job(0, "second", 1, 1, 5))))
    queue.schedule(5, Priority.ARRIVAL, lambda: pool.submit(job(1, "first", 0, 1, 5)))
    queue.run()
    assert [(s.frame, s.stage, s.start_ns) for s in pool.spans] == [(0, "first", 0), (0, "second", 5), (1, "first", 10)]


def test_work_runs_at_the_start_and_its_result_shows_at_the_finish() -> None:
    queue, log = EventQueue(), []
    pool = CorePool(queue, 1)

    def work() -> tuple[str, int]:
        log.append((queue.now_ns, "work"))
        return "result", 7

    for frame in (0, 1):
        pool.submit(Job(frame, "a", 0, 1, work, lambda result: log.append((queue.now_ns, result))))
    queue.run()
    assert log == [(0, "work"), (7, "result"), (7, "work"), (14, "result")]


def test_a_job_that_costs_nothing_starts_and_finishes_in_one_instant() -> None:
    spans = schedule([(3, 0, "a", 0, 1, 0), (3, 0, "b", 1, 1, 0), (3, 1, "a", 0, 2, 1)], cores=2)
    assert [(s.frame, s.stage, s.start_ns, s.end_ns) for s in spans] == [(0, "a", 3, 3), (0, "b", 3, 3), (1, "a", 3, 4)]


def test_what_is_unfinished_at_the_end_can_be_told() -> None:
    queue = EventQueue()
    pool = CorePool(queue, 1)
    for frame in (2, 0, 1):
        pool.submit(job(frame, "a", 0, 1, 10))
    queue.run_until(15)
    assert [(s.frame, s.end_ns) for s in pool.running] == [(1, 20)]
    assert [waiting.frame for waiting in pool.waiting] == [2]


def test_utilisation_counts_the_window_only() -> None:
    queue = EventQueue()
    pool = CorePool(queue, 2)
    pool.submit(job(0, "a", 0, 2, 4))
    pool.submit(job(1, "b", 0, 1, 6))
    queue.run()
    assert pool.utilisation(2, 12) == (0.8, 0.2)
    assert pool.utilisation(5, 5) == (0.0, 0.0)


@pytest.mark.parametrize("cores", [0, 3])
def test_a_claim_that_can_never_be_met_is_an_error(cores: int) -> None:
    pool = CorePool(EventQueue(), 2)
    with pytest.raises(UsageError, match=f"'segment' claims {cores} cores, but the simulated robot has 2"):
        pool.submit(job(0, "segment", 0, cores, 1))
    with pytest.raises(UsageError, match="at least one core"):
        CorePool(EventQueue(), 0)


@pytest.mark.parametrize("cost", [-1, 1.5])
def test_a_cost_is_a_whole_number_of_nanoseconds(cost: int) -> None:
    queue = EventQueue()
    CorePool(queue, 1).submit(job(0, "a", 0, 1, cost))
    with pytest.raises(ValueError, match="the cost of 'a'"):
        queue.run()


def test_ten_frames_worked_out_by_hand() -> None:
    """The schedule of ten frames, 100 ms apart, on two cores.

    Every frame is tracked (30 ms, 1 core); then 0, 4 and 8 are segmented (250 ms, 2 cores) and the others propagated
    (20 ms, 1 core); both are ready at arrival. Frame 0's segmentation waits until its tracking frees the other core and
    runs from 30 to 280; frames 1 and 2 arrive meanwhile and wait. At 280 frame 1 gets both cores; at 300 core 1 goes to
    frame 2, although frame 3 arrives just then; at 330 both cores are free for frame 3. At 400 it begins anew.
    """
    ms = 1_000_000
    requests: list[Request] = []
    for frame in range(10):
        requests.append((frame * 100 * ms, frame, "track", 0, 1, 30 * ms))
        cores, cost = (2, 250) if frame in (0, 4, 8) else (1, 20)
        requests.append((frame * 100 * ms, frame, "segment" if cores == 2 else "propagate", 1, cores, cost * ms))
    hand = [
        (0, 30, (0,), 0, "track"),
        (30, 280, (0, 1), 0, "segment"),
        (280, 310, (0,), 1, "track"),
        (280, 300, (1,), 1, "propagate"),
        (300, 330, (1,), 2, "track"),
        (310, 330, (0,), 2, "propagate"),
        (330, 360, (0,), 3, "track"),
        (330, 350, (1,), 3, "propagate"),
        (400, 430, (0,), 4, "track"),
        (430, 680, (0, 1), 4, "segment"),
        (680, 710, (0,), 5, "track"),
        (680, 700, (1,), 5, "propagate"),
        (700, 730, (1,), 6, "track"),
        (710, 730, (0,), 6, "propagate"),
        (730, 760, (0,), 7, "track"),
        (730, 750, (1,), 7, "propagate"),
        (800, 830, (0,), 8, "track"),
        (830, 1080, (0, 1), 8, "segment"),
        (1080, 1110, (0,), 9, "track"),
        (1080, 1100, (1,), 9, "propagate"),
    ]
    spans = schedule(requests)
    assert [(s.start_ns, s.end_ns, s.cores, s.frame, s.stage) for s in spans] == [
        (start * ms, end * ms, cores, frame, stage) for start, end, cores, frame, stage in hand
    ]
    assert schedule_text(spans[:2]) == (
        "        start ms           end ms        waited ms  cores frame stage\n"
        "        0.000000        30.000000         0.000000  0         0 track\n"
        "       30.000000       280.000000        30.000000  0+1       0 segment\n"
    )


a_request = st.tuples(
    st.integers(0, 12), st.integers(0, 6), st.sampled_from("abc"), st.integers(0, 2), st.integers(1, 3),
    st.integers(0, 5),
)  # fmt: skip
requests = st.lists(a_request, max_size=25)
distinct_requests = st.lists(a_request, max_size=25, unique_by=lambda request: (request[1], request[2]))
"""No frame asks for one stage twice."""


@settings(max_examples=200, derandomize=True)
@given(requests)
def test_every_job_runs_once_for_its_cost_on_cores_of_its_own(jobs: list[Request]) -> None:
    spans = schedule(jobs, cores=3)
    given_jobs = sorted((frame, stage, cores, ready, cost) for ready, frame, stage, _, cores, cost in jobs)
    assert sorted((s.frame, s.stage, len(s.cores), s.ready_ns, s.end_ns - s.start_ns) for s in spans) == given_jobs
    for core in range(3):
        held = sorted((s.start_ns, s.end_ns) for s in spans if core in s.cores)
        assert all(end <= start for (_, end), (start, _) in pairwise(held))
    assert all(s.start_ns >= s.ready_ns and list(s.cores) == sorted(set(s.cores)) for s in spans)


def test_nothing_overtakes() -> None:
    """Whoever starts while an older job is ready and waiting would have overtaken it; such pairs are plenty."""
    seen = 0

    @settings(max_examples=200, derandomize=True, database=None)
    @given(distinct_requests)
    def check(jobs: list[Request]) -> None:
        nonlocal seen
        spans = schedule(jobs, cores=3)
        orders = {(frame, stage): order for _, frame, stage, order, _, _ in jobs}
        waited = [(a, b) for a, b in permutations(spans, 2) if b.ready_ns <= a.start_ns < b.start_ns]
        for early, late in waited:
            assert (early.frame, orders[early.frame, early.stage]) <= (late.frame, orders[late.frame, late.stage])
        seen += len(waited)

    check()
    assert seen > 1000


@settings(max_examples=100, derandomize=True)
@given(requests, st.randoms(use_true_random=False))
def test_the_order_of_submission_within_an_instant_does_not_matter(jobs: list[Request], random: object) -> None:
    jobs = list(
        {(frame, order, stage): request for request in jobs for _, frame, stage, order, _, _ in [request]}.values()
    )
    shuffled = sorted(jobs, key=lambda _: random.random())  # type: ignore[attr-defined]
    assert schedule(jobs, cores=3) == schedule(shuffled, cores=3)
