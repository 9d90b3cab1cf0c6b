"""Where errors become exit codes, once for every verb."""

import functools
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NoReturn, ParamSpec, cast

import typer

from stsem.errors import EXIT_ERROR, EXIT_FINE, EXIT_USAGE, StsemError
from stsem.plain import MAX_SENTENCE, plain

P = ParamSpec("P")
_Misused = cast(type[typer.BadParameter], typer.BadParameter.__mro__[1])
"""The parent of every complaint about arguments; typer gives it no public name."""

_ENDINGS = {
    name: getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
}  # fmt: skip
"""Signals that end a command in order: what it was writing is removed."""
_NO_MEMORY = re.compile(r"can't allocate memory|Insufficient memory|out of memory")
"""What torch and OpenCV say instead of raising MemoryError."""


def launch(app: typer.Typer) -> NoReturn:
    """Run the command line of this process; a flag that cannot be is one sentence on stderr, too."""
    try:
        code = app(standalone_mode=False)
    except _Misused as err:
        text = " ".join(err.format_message().split()).rstrip(".")
        code = _say(f"{text}; --help shows what there is.", EXIT_USAGE)
    except typer.Abort:
        code = EXIT_ERROR
    sys.exit(code)


def verb(function: Callable[P, int | None]) -> Callable[P, None]:
    """A command whose errors are one sentence on stderr and whose return value is its exit code.

    With STSEM_DEBUG=1 the traceback is shown instead.
    """

    @functools.wraps(function)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> None:
        raise typer.Exit(_run(lambda: function(*args, **kwargs)))

    return guarded


def _run(body: Callable[[], int | None]) -> int:
    if os.environ.get("STSEM_DEBUG") == "1":
        return body() or EXIT_FINE
    came: list[int] = []

    def end(number: int, frame: object) -> NoReturn:
        came.append(number)
        raise KeyboardInterrupt

    before = {
        number: signal.signal(number, end)
        for number in _ENDINGS.values()
        if signal.getsignal(number) != signal.SIG_IGN  # nohup wants the command to go on
    }
    try:
        return body() or EXIT_FINE
    except StsemError as err:
        return _say(str(err), err.exit_code)
    except KeyboardInterrupt:
        return _say(_ended(came), EXIT_ERROR)
    except BrokenPipeError:
        sys.stderr.close()
        return EXIT_ERROR
    except (typer.Exit, typer.Abort):
        raise
    except Exception as err:  # noqa: BLE001 - the last line of defence: a bug is told in one sentence, too
        if came:  # a library that was being loaded turned Ctrl-C into an error of its own
            return _say(_ended(came), EXIT_ERROR)
        return _say(_unexpected(err), EXIT_ERROR)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _ended(came: Sequence[int]) -> str:
    """How, and that nothing needs to be cleaned up."""
    by = f"Ended by {signal.Signals(came[0]).name}" if came and came[0] != signal.SIGINT else "Interrupted"
    return f"{by}; nothing half-written is left behind."


def _unexpected(err: Exception) -> str:
    """What nobody foresaw, in one sentence."""
    if isinstance(err, MemoryError) or _NO_MEMORY.search(str(err)):
        return ("The memory of this machine is used up; close other programs, or take less at once: a shorter window, "
                "a smaller network, crop or batch.")  # fmt: skip
    if isinstance(err, OSError):
        place = f" ({err.filename})" if err.filename else ""
        return f"The system refused{place}: {err.strerror or err}."
    what = f"{type(err).__name__}: {err}".replace("\n", " ")
    return f"This is a defect of stsem, please report it with STSEM_DEBUG=1: {what}."


def _say(text: str, code: int) -> int:
    with suppress(OSError):  # the terminal may be gone
        print(f"stsem: {plain(text, MAX_SENTENCE)}", file=sys.stderr)
    return code
