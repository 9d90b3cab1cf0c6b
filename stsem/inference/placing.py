"""The two files of a network, ONNX and sidecar: they take their places together, once they are checked."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from stsem.aside import aside
from stsem.errors import NetworkError, OutputError
from stsem.inference.sidecar import Sidecar, parse, render


@contextmanager
def placed(path: Path, sidecar: Sidecar) -> Iterator[Path]:
    """Where to write and check the network that will be `path` (.onnx); its sidecar lies beside it already.

    At the end both replace what was at `path`; where anything fails that stays. A sidecar there that says the same
    stays in any case, with its comments.

    Raises:
        OutputError: a file cannot be written.
    """
    trial = aside(path)
    try:
        trial.mkdir()
        unchecked = trial / path.name
        unchecked.with_suffix(".toml").write_text(render(sidecar), encoding="utf-8")
        yield unchecked
        beside = path.with_suffix(".toml")
        if not _says(beside, sidecar):
            unchecked.with_suffix(".toml").replace(beside)
        unchecked.replace(path)
    except OSError as err:
        raise OutputError(f"The network cannot be written to {path}: {err.strerror}.") from err
    finally:
        shutil.rmtree(trial, ignore_errors=True)


def _says(beside: Path, sidecar: Sidecar) -> bool:
    with suppress(FileNotFoundError, UnicodeDecodeError, NetworkError):
        return parse(beside.read_text(encoding="utf-8"), str(beside)) == sidecar
    return False
