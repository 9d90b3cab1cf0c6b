"""Coverage-guided fuzzing of an entry of `entries.py` with atheris, which is not a dependency (`pip install atheris`).

    python -m tests.fuzz.atheris_log log corpus/ -max_total_time=600
    python -m tests.fuzz.atheris_log rvl corpus/ crash-1234

The folder is given its first files when it does not exist; everything behind the entry goes to libFuzzer.
"""

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.fuzz.entries import Entry

MISSING = "atheris is not installed; pip install atheris (Linux and macOS), or run python -m tests.fuzz without it."
USAGE = "usage: python -m tests.fuzz.atheris_log ENTRY FOLDER [libFuzzer options]; entries: {}"
LIMITS = ("-rss_limit_mb=2048", "-timeout=10")


def main(arguments: list[str]) -> int:
    """Run until a bug is found, or libFuzzer's limits are met."""
    atheris = None
    with contextlib.suppress(ImportError):
        import atheris
    with atheris.instrument_imports(include=["stsem"]) if atheris else contextlib.nullcontext():
        from tests.fuzz.entries import ENTRIES
    if len(arguments) < 2 or arguments[0] not in ENTRIES:
        print(USAGE.format(", ".join(ENTRIES)), file=sys.stderr)
        return 2
    if atheris is None:
        print(MISSING, file=sys.stderr)
        return 1
    name, folder, *options = arguments
    entry = ENTRIES[name]
    write_seeds(entry, Path(folder))
    atheris.Setup([sys.argv[0], folder, *LIMITS, *options], entry)
    atheris.Fuzz()
    return 0


def write_seeds(entry: "Entry", folder: Path) -> None:
    """The bytes to begin with, as files, into a folder that does not exist yet."""
    if folder.is_dir():
        return
    folder.mkdir(parents=True)
    for number, data in enumerate(entry.seeds()):
        (folder / f"seed-{number}").write_bytes(data)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
