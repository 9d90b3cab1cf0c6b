"""Where errors become exit codes, once for every verb."""

import functools
import os
import signal
import sys
from collections.abc import Callable
from typing import NoReturn, ParamSpec, cast

import typer

from stsem.errors import EXIT_ERROR, EXIT_FINE, EXIT_USAGE, StsemError
from stsem.plain import MAX_SENTENCE, plain

P = ParamSpec("P")
_Misused = cast(type[typer.BadParameter], typer.BadParameter.__mro__[1])
"""The parent of every complaint about arguments; typer gives it no public name."""

_INTERRUPTED = "Interrupted; no half-written report is left behind."


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
    interrupts: list[int] = []

    def interrupt(number: int, frame: object) -> NoReturn:
        interrupts.append(number)
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        return body() or EXIT_FINE
    except StsemError as err:
        return _say(str(err), err.exit_code)
    except KeyboardInterrupt:
        return _say(_INTERRUPTED, EXIT_ERROR)
    except BrokenPipeError:
        sys.stderr.close()
        return EXIT_ERROR
    except (typer.Exit, typer.Abort):
        raise
    except Exception as err:  # noqa: BLE001 - the last line of defence: a bug is told in one sentence, too
        if interrupts:  # a library that was being loaded turned Ctrl-C into an error of its own
            return _say(_INTERRUPTED, EXIT_ERROR)
        return _say(_unexpected(err), EXIT_ERROR)
    finally:
        signal.signal(signal.SIGINT, before)


def _unexpected(err: Exception) -> str:
    """What nobody foresaw, in one sentence."""
    if isinstance(err, MemoryError):
        return "The memory of this machine is used up; close other programs or take a smaller window."
    if isinstance(err, OSError):
        place = f" ({err.filename})" if err.filename else ""
        return f"The system refused{place}: {err.strerror or err}."
    what = f"{type(err).__name__}: {err}".replace("\n", " ")
    return f"This is a defect of stsem, please report it with STSEM_DEBUG=1: {what}."


def _say(text: str, code: int) -> int:
    print(f"stsem: {plain(text, MAX_SENTENCE)}", file=sys.stderr)
    return code
