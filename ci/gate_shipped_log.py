"""Gate this version on the log that ships: the oracle exactly, the default network within limits."""

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOG = ROOT / "logs" / "office.mcap"
COSTS = ROOT / "bench" / "costs" / "reference.json"
BASELINES = ROOT / "ci" / "baselines"

RUNS = {
    "oracle": ["--model", "oracle", "--keyframes", "every:5", "--propagation", "hold"],
    "default": [],
}
"""Name of the baseline -> what is replayed. `hold` keeps the oracle free of arithmetic that differs between CPUs."""


def stsem(*arguments: str | Path) -> int:
    """Run one command of this installation; its exit code."""
    program = "import sys; from stsem.cli.main import stsem; sys.exit(stsem())"
    return subprocess.run([sys.executable, "-c", program, *map(str, arguments)], cwd=ROOT, check=False).returncode


def main(accept: bool) -> int:
    """Replay and gate each run; with `accept`, write its baseline instead."""
    worst = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name, arguments in RUNS.items():
            report = Path(scratch) / name
            code = stsem("replay", LOG, "--costs", COSTS, "--no-plots", "--out", report, *arguments)
            if code == 0:
                baseline = BASELINES / f"{name}.json"
                flag = "--write-baseline" if accept else "--baseline"
                code = stsem("gate", report, flag, baseline)
            worst = max(worst, code)
    return worst


if __name__ == "__main__":
    sys.exit(main(accept="--accept" in sys.argv[1:]))
