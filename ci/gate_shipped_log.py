"""Gate this version on the log that ships: the oracle exactly, the default network within limits."""

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOG = ROOT / "logs" / "office.mcap"
COSTS = ROOT / "bench" / "costs" / "reference.json"
BASELINES = ROOT / "ci" / "baselines"

RUNS: dict[str, tuple[list[str], list[str]]] = {
    "oracle": (["--model", "oracle", "--keyframes", "every:5", "--propagation", "hold"], []),
    "default": ([], ["--limit", "streaming.miou=2", "--limit", "latency_ms.from_arrival.max=10"]),
}
"""Name of the baseline -> (what is replayed, limits). `hold` keeps the oracle free of arithmetic that differs between
kinds of CPU, so it must be equal; on another CPU another keyframe may be chosen, which moves the rest a little."""


def stsem(*arguments: str | Path) -> int:
    """Run one command of this installation; its exit code."""
    program = "import sys; from stsem.cli.main import stsem; sys.exit(stsem())"
    return subprocess.run([sys.executable, "-c", program, *map(str, arguments)], cwd=ROOT, check=False).returncode


def main(accept: bool) -> int:
    """Replay and gate each run; with `accept`, write its baseline instead."""
    worst = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name, (arguments, limits) in RUNS.items():
            report = Path(scratch) / name
            code = stsem("replay", LOG, "--costs", COSTS, "--no-plots", "--out", report, *arguments)
            if code == 0:
                baseline = BASELINES / f"{name}.json"
                judged = ["--write-baseline", baseline] if accept else ["--baseline", baseline, *limits]
                code = stsem("gate", report, *judged)
            worst = max(worst, code)
    return worst


if __name__ == "__main__":
    sys.exit(main(accept="--accept" in sys.argv[1:]))
