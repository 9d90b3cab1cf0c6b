"""Every backend in every precision on one log: accuracy, agreement with the reference, time. See docs/measurements.md.

stsem synth .scratch/calibration.mcap --seed 11 --layout 5200 --speed varying
stsem quantize default --log .scratch/calibration.mcap
python bench/precision.py --network default --log logs/office.mcap
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from tabulate import tabulate

from stsem import hostclock
from stsem.classes import Labels
from stsem.errors import StsemError
from stsem.frame import Frame
from stsem.inference.backends import BACKENDS, DEFAULT_BACKEND, DEFAULT_PRECISION
from stsem.inference.inferencer import Inferencer, Output, segmentation
from stsem.inference.network import Network, load_network
from stsem.inference.threads import set_threads
from stsem.log.log import open_log
from stsem.metrics.confusion import ConfusionMatrix

THREADS = (2, 1)
REFERENCE = (DEFAULT_BACKEND, DEFAULT_PRECISION)
WARM_UP = 2


@dataclass
class Row:
    """One backend in one precision, and what is known of it so far."""

    sessions: dict[int, Inferencer]
    matrix: ConfusionMatrix
    wall_ns: dict[int, list[int]] = field(default_factory=lambda: {threads: [] for threads in THREADS})
    cpu_ns: dict[int, list[int]] = field(default_factory=lambda: {threads: [] for threads in THREADS})
    agreement: list[float] = field(default_factory=list)
    same_for_threads: bool = True

    def run(self, frame: Frame, truth: Labels) -> Output:
        """The frame once with each number of threads; the first gives the answer."""
        answers = [self._timed(threads, frame) for threads in THREADS]
        self.same_for_threads &= all(_bytes(answer) == _bytes(answers[0]) for answer in answers)
        self.matrix.update(truth, segmentation(answers[0], frame.size).labels)
        return answers[0]

    def _timed(self, threads: int, frame: Frame) -> Output:
        wall, cpu = hostclock.wall_ns(), hostclock.process_cpu_ns()
        answer = self.sessions[threads].compute(frame)
        self.wall_ns[threads].append(hostclock.wall_ns() - wall)
        self.cpu_ns[threads].append(hostclock.process_cpu_ns() - cpu)
        return answer


def _bytes(answer: Output) -> bytes:
    return answer.labels.tobytes() + answer.confidence.tobytes()


def rows_of(network: Network) -> dict[tuple[str, str], Row]:
    """What can run here; the rest is said and left out."""
    rows = {}
    for backend, row in BACKENDS.items():
        for precision in row.precisions:
            try:
                sessions = {n: Inferencer(network, backend=backend, precision=precision, threads=n) for n in THREADS}
            except StsemError as err:
                print(f"{backend} {precision} is left out: {err}")
                continue
            rows[backend, precision] = Row(sessions, ConfusionMatrix(len(network.classes)))
    return rows


def judged(network: Network, log_path: Path) -> Iterator[tuple[Frame, Labels]]:
    """Frames with truth, in the log's classes, which must be the network's."""
    with open_log([log_path]) as log:
        assert log.classes is not None
        assert log.classes.names == network.classes.names
        found = log.frames(range(len(log.plans)), depth=network.has_depth, previous=True, truth=True)
        yield from ((loaded.frame, loaded.truth) for loaded in found if loaded.frame and loaded.truth is not None)


def measure(network: Network, log_path: Path) -> dict[tuple[str, str], Row]:
    """Every frame through every row in turn, so that what else the machine does falls on all of them alike."""
    rows = rows_of(network)
    for frame, truth in judged(network, log_path):
        reference = rows[REFERENCE].run(frame, truth)
        for name, row in rows.items():
            answer = reference if name == REFERENCE else row.run(frame, truth)
            row.agreement.append(float((answer.labels == reference.labels).mean()))
    return rows


def _cells(name: tuple[str, str], row: Row) -> tuple[object, ...]:
    scores = row.matrix.compute()
    times = [f"{np.median(found[n][WARM_UP:]) / 1e6:.0f}" for n in THREADS for found in (row.wall_ns, row.cpu_ns)]
    return (
        *name, f"{scores.miou:.2%}", f"{scores.pixel_accuracy:.2%}", f"{np.mean(row.agreement):.2%}", *times,
        "yes" if row.same_for_threads else "NO",
    )  # fmt: skip


def main() -> None:
    """Print the table, in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--network", default="default")
    parser.add_argument("--log", type=Path, default=Path("logs/office.mcap"))
    given = parser.parse_args()
    set_threads(1)
    busy, own, began = hostclock.machine_busy_ns(), hostclock.process_cpu_ns(), hostclock.wall_ns()
    network = load_network(given.network)
    rows = measure(network, given.log)
    times = [f"{what}, {n} thread{'s' * (n > 1)}, ms" for n in THREADS for what in ("wall", "CPU")]
    headers = ("backend", "precision", "mIoU", "pixel accuracy", "labels as the reference", *times, "same bytes")
    print(tabulate([_cells(*item) for item in rows.items()], headers, tablefmt="github", disable_numparse=True))
    sums = {name: row.sessions[THREADS[0]].network.model_sha256[:8] for name, row in rows.items()}
    print(f"\n{hostclock.machine_name()}; {len(rows[REFERENCE].agreement)} frames; files {sorted(set(sums.values()))}")
    if busy is not None and (after := hostclock.machine_busy_ns()) is not None:
        others = (after - busy - hostclock.process_cpu_ns() + own) / (hostclock.wall_ns() - began)
        print(f"Other work held {others:.1f} cores on average meanwhile.")


if __name__ == "__main__":
    main()
