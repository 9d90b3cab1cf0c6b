"""A training in a process of its own, which kills itself: `killed.py PAIRS FOLDER MOMENT`.

MOMENT is `step:N`, right after iteration N, or `save:N`, with half of the checkpoint of iteration N written.
"""

import os
import signal
import sys
from pathlib import Path
from typing import Any

import torch

from stsem.train.dataset import PairFolder
from stsem.train.stages import Progress, train_stage

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests.train.test_killed import JOB


def main(pairs: Path, folder: Path, moment: str) -> None:
    kind, _, number = moment.partition(":")
    save, at = torch.save, int(number)

    def half(state: dict[str, Any], path: Path) -> None:
        save(state, path)
        if kind == "save" and state["iteration"] == at:
            os.truncate(path, path.stat().st_size // 2)
            os.kill(os.getpid(), signal.SIGKILL)

    def report(now: Progress) -> None:
        if kind == "step" and now.iteration == at:
            os.kill(os.getpid(), signal.SIGKILL)

    torch.save = half
    train_stage(JOB, PairFolder(pairs), None, folder, report)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
