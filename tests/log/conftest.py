"""Small logs for the tests of this folder."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from made_up_logs import Recorder, room


@pytest.fixture
def recorder(tmp_path: Path) -> Callable[..., Recorder]:
    """Makes recorders of files in the test's folder."""

    def make(name: str = "log.mcap", **options: Any) -> Recorder:
        return Recorder(tmp_path / name, **options)

    return make


@pytest.fixture
def room_log(tmp_path: Path) -> Path:
    """The small complete log."""
    return room(tmp_path / "room.mcap")
