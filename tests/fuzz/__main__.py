"""Mutates small logs and judges what becomes of them: `python -m tests.fuzz --seeds 0 10000`.

A seed is a mutant for good: a range can be split, and run again. Failing mutants are printed and kept as files.
"""

import argparse
import re
import sys
from collections import Counter
from pathlib import Path

from tests.fuzz.campaign import judging, tasks
from tests.fuzz.mutate import mutant
from tests.fuzz.subjects import SUBJECTS, THREE, written
from tests.fuzz.workers import Verdict, verdicts

EACH = 500


def main() -> int:
    """Exit code 1 when a mutant failed."""
    wanted = _arguments()
    todo = list(tasks(wanted.logs, *wanted.seeds))
    print(f"{len(todo)} mutants of {', '.join(wanted.logs)}, seeds {wanted.seeds[0]} to {wanted.seeds[1] - 1}")
    found: list[Verdict] = []
    for verdict in verdicts(judging, todo, wanted.processes):
        found.append(verdict)
        if verdict.reason:
            print(f"FAILED {verdict.log} {verdict.seed} ({', '.join(verdict.operators)}): {verdict.reason}", flush=True)
        if len(found) % EACH == 0:
            print(f"{len(found)} done", file=sys.stderr, flush=True)
    failed = [verdict for verdict in found if verdict.reason]
    _keep(failed, wanted.keep)
    print(summary(found))
    return bool(failed)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seeds", nargs=2, type=int, default=(0, 10_000), metavar=("FIRST", "END"))
    parser.add_argument("--logs", nargs="+", choices=SUBJECTS, default=list(THREE))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--keep", type=Path, default=Path("runs/fuzz"), help="folder for mutants that failed")
    return parser.parse_args()


def _keep(failed: list[Verdict], folder: Path) -> None:
    if not failed:
        return
    logs = written(folder)
    for verdict in failed:
        path = folder / f"{verdict.log}-{verdict.seed}.mcap"
        path.write_bytes(mutant(logs, verdict.log, verdict.seed).data)
        print(f"kept {path}")


def summary(found: list[Verdict]) -> str:
    """Counts by log and kind, the sentences, and the worst."""
    kinds = Counter((verdict.log, verdict.kind) for verdict in found)
    lines = [f"{log:14} {kind:8} {n}" for (log, kind), n in sorted(kinds.items())]
    sentences = Counter(_shape(verdict.what) for verdict in found if verdict.kind == "refused")
    lines += [f"{n:6} refused: {sentence}" for sentence, n in sentences.most_common(20)]
    slowest, largest = max(found, key=lambda v: v.seconds), max(found, key=lambda v: v.peak_bytes)
    lines += [
        f"slowest: {slowest.seconds:.2f} s ({slowest.log} {slowest.seed}); "
        f"most memory: {largest.peak_bytes / 2**20:.0f} MiB ({largest.log} {largest.seed})",
        f"{len(found)} mutants, {sum(bool(verdict.reason) for verdict in found)} failed",
    ]
    return "\n".join(lines)


def _shape(sentence: str) -> str:
    """A sentence without what is different in each: paths, numbers, names."""
    return re.sub(r"\d+", "N", re.sub(r"/\S+", "PATH", sentence))[:90]


if __name__ == "__main__":
    sys.exit(main())
