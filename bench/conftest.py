"""The log that benchmarks share."""

from pathlib import Path

import pytest

from bench.recording import write_log


@pytest.fixture(scope="session")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("bench") / "bench.mcap")
