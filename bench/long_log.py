"""Time and memory of logs of up to 3 hours and 100 GB that exist nowhere (tests/log/looping_log.py); needs `remote`.

    python bench/long_log.py scan 8 4 2 1      # open_log; 1/8 to 1/1 of 100 GB
    python bench/long_log.py replay 8 4 2 1    # the whole replay of small images, report included

Each size runs in a process of its own; a row of the table in docs/measurements.md is printed for each. Beside other
work the processor time is the better measure.
"""

import resource
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stdout, suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "log"))

FULL_CHUNKS = 32_400
"""Of 10 frames: 3 hours at 30 Hz."""
BULK_BYTES = {"scan": 300_000, "replay": 1_000}


def main() -> None:
    what, *parts = sys.argv[1:]
    if what in BULK_BYTES:
        print("| work | part | frames | GB | CPU s | wall s | peak MB |\n|---|---|---|---|---|---|---|")
        for part in parts:
            subprocess.run([sys.executable, __file__, f"one-{what}", part], check=True, cwd=ROOT)
    else:
        one(what.removeprefix("one-"), int(part := parts[0]), part)


def one(what: str, part: int, shown: str) -> None:
    from looping_log import FRAMES, LoopingLog, register

    register()
    chunks = FULL_CHUNKS // part
    address = f"loop://{chunks}/{BULK_BYTES[what]}/long.mcap"
    began = time.perf_counter()
    {"scan": scan, "replay": replay}[what](address)
    wall, cpu = time.perf_counter() - began, time.process_time()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    size = LoopingLog(chunks, BULK_BYTES[what]).size / 1e9
    print(f"| {what} | 1/{shown} | {chunks * FRAMES} | {size:.2f} | {cpu:.0f} | {wall:.0f} | {peak:.0f} |", flush=True)


def scan(address: str) -> None:
    from stsem.log.log import open_log

    with open_log([address]) as log:
        assert not log.info.damage.lossy


def replay(address: str) -> None:
    from stsem.cli import main as cli

    with tempfile.TemporaryDirectory() as folder:
        costs = str(ROOT / "bench" / "costs" / "reference.json")
        sys.argv = ["stsem", "replay", address, "--model", "oracle", "--costs", costs, "--keyframes", "every:5",
                    "--propagation", "hold", "--map", "off", "--out", f"{folder}/report", "--json"]  # fmt: skip
        with Path("/dev/null").open("w") as nowhere, redirect_stdout(nowhere), suppress(SystemExit):
            cli.stsem()
        assert (Path(folder) / "report" / "report.json").is_file()


if __name__ == "__main__":
    main()
