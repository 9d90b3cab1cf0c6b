"""Files given together must be parts of one recording."""

import shutil
from pathlib import Path

import pytest

from stsem.errors import LogError
from stsem.log.log import open_log

LOGS = Path(__file__).resolve().parents[2] / "logs"


def test_logs_of_the_same_time_are_not_parts(tmp_path: Path) -> None:
    """Two logs whose images interleave in time are refused, by name."""
    for name in ("tiny-a.mcap", "tiny-b.mcap"):
        shutil.copy(LOGS / name, tmp_path / name)
    with pytest.raises(LogError, match=r"tiny-[ab]\.mcap and tiny-[ab]\.mcap hold colour images of the same time"):
        open_log([tmp_path])
