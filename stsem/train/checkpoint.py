"""Checkpoints of trainings: written aside and renamed, so that there is always a whole one."""

import pickle  # noqa: TID251 - only the name of its error: nothing is unpickled
import zipfile
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path
from typing import Any

import torch

from stsem.aside import aside
from stsem.errors import OutputError, TrainingError

FORMAT = 1
"""Of the checkpoint; another one is refused."""


def write_checkpoint(path: Path, state: dict[str, Any]) -> None:
    """Write tensors and plain values. Raises OutputError, and the checkpoint that was there stays."""
    unfinished = aside(path)
    try:
        torch.save(state, unfinished)
        unfinished.replace(path)
    except (OSError, RuntimeError) as err:  # the latter is what torch makes of a full disk
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        why = err.strerror if isinstance(err, OSError) and err.strerror else "the disk may be full"
        raise OutputError(f"The checkpoint {path} cannot be written ({why}); the one before it is kept: "
                          "make room, and the same command goes on.") from err  # fmt: skip
    except BaseException:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise


def read_checkpoint(path: Path) -> dict[str, Any]:
    """A checkpoint's state; tensors and plain values only. Raises TrainingError."""
    if not zipfile.is_zipfile(path):  # torch would ask for an unsafe way to read it
        raise TrainingError(f"The checkpoint {path} is missing or damaged; give one that a training wrote.")
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, EOFError, ValueError, KeyError, pickle.UnpicklingError) as err:
        reason = " ".join(str(err).split())[:120]
        raise TrainingError(
            f"The checkpoint {path} cannot be read ({reason}); give one that a training wrote."
        ) from err
    if not (isinstance(state, dict) and {"architecture", "mean"} <= state.keys()):
        raise TrainingError(f"{path} holds no checkpoint of a training; give one that a training wrote.")
    return state


def averaged_weights(state: dict[str, Any]) -> dict[str, torch.Tensor]:
    """The averaged weights in a checkpoint's state, as the network names them."""
    return {key.removeprefix("module."): value for key, value in state["mean"].items() if key.startswith("module.")}


def file_sha256(path: Path) -> str:
    """Of a file of weights. Raises TrainingError."""
    try:
        with path.open("rb") as file:
            return file_digest(file, "sha256").hexdigest()
    except OSError as err:
        raise TrainingError(f"The weights {path} cannot be read: {err.strerror or err}.") from err
