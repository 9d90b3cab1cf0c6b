"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_logs() -> Path:
    """Folder of recorded logs that cannot be redistributed: STSEM_SHARED_LOGS, else ../shared/logs beside the checkout."""
    folder = Path(os.environ.get("STSEM_SHARED_LOGS", ROOT.parent / "shared" / "logs"))
    if not folder.is_dir():
        pytest.skip(f"the recorded logs are not at hand: no folder {folder} (set STSEM_SHARED_LOGS)")
    return folder
