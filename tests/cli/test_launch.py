"""Errors become exit codes in one place."""

import os
import signal
import threading
from collections.abc import Callable

import pytest
import typer

from stsem.cli.launch import verb
from stsem.errors import ChannelError, DecodeError, NothingMeasuredError, OutputError, UsageError

WAIT = threading.Event()


def ended(body: Callable[[], int | None]) -> int:
    """Exit code of a verb with this body."""
    with pytest.raises(typer.Exit) as end:
        verb(body)()
    return end.value.exit_code


def raising(error: BaseException) -> Callable[[], int]:
    def body() -> int:
        raise error

    return body


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (UsageError("Give a number."), 2, "Give a number."),
        (ChannelError("No images."), 1, "No images."),
        (DecodeError("/a", 5, "too short"), 1, "/a at 5 ns: too short."),
        (OutputError("Full."), 1, "Full."),
        (NothingMeasuredError("Nothing."), 5, "Nothing."),
        (KeyboardInterrupt(), 1, "Interrupted; nothing half-written is left behind."),
        (RuntimeError("two\nlines"), 1, "This is a defect of stsem, please report it with STSEM_DEBUG=1: "
         "RuntimeError: two lines."),
        (RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes."), 1,
         "The memory of this machine is used up; close other programs, or take less at once: a shorter window, a "
         "smaller network, crop or batch."),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)  # fmt: skip
def test_one_sentence_and_a_code(
    error: BaseException, code: int, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """On stderr, with the name of the command, and nothing else."""
    assert ended(raising(error)) == code
    assert capsys.readouterr() == ("", f"stsem: {text}\n")


def test_what_a_verb_returns() -> None:
    """Its exit code; None is fine."""
    assert [ended(lambda code=code: code) for code in (None, 0, 3, 4)] == [0, 0, 3, 4]  # type: ignore[misc]


def test_debugging_shows_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    """STSEM_DEBUG=1 lets the exception through."""
    monkeypatch.setenv("STSEM_DEBUG", "1")
    with pytest.raises(RuntimeError, match="inside"):
        verb(raising(RuntimeError("inside")))()


def test_an_interrupt_in_disguise(capsys: pytest.CaptureFixture[str]) -> None:
    """A library that is interrupted while it loads raises an error of its own; that is no defect."""

    def body() -> int:
        try:
            os.kill(os.getpid(), signal.SIGINT)
            WAIT.wait(10)
        except KeyboardInterrupt:
            raise ImportError("initialization failed") from None
        return 0

    before = signal.getsignal(signal.SIGINT)
    assert ended(body) == 1
    assert capsys.readouterr().err == "stsem: Interrupted; nothing half-written is left behind.\n"
    assert signal.getsignal(signal.SIGINT) is before
