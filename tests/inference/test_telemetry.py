"""ONNX Runtime sends nothing home and writes nothing there, unless asked to."""

import os
import subprocess
import sys
from pathlib import Path


def test_nothing_is_written_to_the_home_folder(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "ORT_DISABLE_TELEMETRY"}
    environment |= {"HOME": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("XDG_CACHE_HOME", None)
    command = [sys.executable, "-c", "import stsem.inference.backends"]
    subprocess.run(command, check=True, env=environment, cwd=Path(__file__).resolve().parents[2])
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == []
