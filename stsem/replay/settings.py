"""Where a configuration comes from: defaults < stsem.toml < STSEM_* < flags and --set (DESIGN 8)."""

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from stsem.errors import UsageError
from stsem.replay.config import RunConfig

DEFAULT_FILE = Path("stsem.toml")
ENVIRONMENT_PREFIX = "STSEM_"
NOT_CONFIG = frozenset({"STSEM_CACHE", "STSEM_DEBUG", "STSEM_SHARED_LOGS"})


def keys() -> tuple[str, ...]:
    """Every configuration key, as spelled in TOML."""
    return tuple(field.alias or name for name, field in RunConfig.model_fields.items())


def resolve(
    flags: Mapping[str, Any],
    *,
    file: Path | None = None,
    environment: Mapping[str, str] | None = None,
    assignments: Iterable[str] = (),
) -> RunConfig:
    """One configuration from all its sources.

    Args:
        flags: values given on the command line; None means not given.
        file: TOML file; None means `stsem.toml` in the current folder if there is one.
        environment: process environment.
        assignments: `key=value` texts of `--set`, values in TOML spelling, or bare text.

    Raises:
        UsageError: an unknown key (the nearest valid one is named), or a value that cannot be.
    """
    merged: dict[str, Any] = {}
    for source, values in (
        _from_file(file),
        ("the environment", _from_environment(environment or {})),
        ("--set", _from_assignments(assignments)),
        ("the command line", {key: value for key, value in flags.items() if value is not None}),
    ):
        for key, value in values.items():
            if key not in keys():
                raise UsageError(f"Unknown key {key!r} in {source}{nearest(key, keys())}")
            merged[key] = _joined(merged.get(key), value)
    return validated(merged)


def validated(values: Mapping[str, Any]) -> RunConfig:
    """A configuration from values by key.

    Raises:
        UsageError: a value that cannot be.
    """
    try:
        return RunConfig.model_validate(values)
    except ValidationError as err:
        raise UsageError(sentence(err)) from err


def nearest(word: str, valid: Iterable[str]) -> str:
    """The end of a sentence: did you mean the valid word that `word` is closest to, or all when none is close."""
    valid = tuple(valid)
    close = difflib.get_close_matches(word, valid, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; the valid ones are {', '.join(sorted(valid))}."


def sentence(err: ValidationError) -> str:
    """The first problem of a pydantic error, as one sentence naming key, value and what was expected."""
    first = err.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    came = "" if first["type"].endswith("_error") and not key else f" (came: {first['input']!r})"
    message = first["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    return f"{key}: {message}{came}." if key else f"The configuration cannot be: {message}."


def _from_file(file: Path | None) -> tuple[str, dict[str, Any]]:
    if file is None and not DEFAULT_FILE.is_file():
        return "", {}
    path = file or DEFAULT_FILE
    try:
        return str(path), tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as err:
        raise UsageError(f"The configuration {path} cannot be read: {err.strerror or err}.") from err
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as err:
        raise UsageError(f"The configuration {path} is not valid TOML: {err}.") from err


def _from_environment(environment: Mapping[str, str]) -> dict[str, Any]:
    return {
        name.removeprefix(ENVIRONMENT_PREFIX).lower(): _literal(value)
        for name, value in sorted(environment.items())
        if name.startswith(ENVIRONMENT_PREFIX) and name not in NOT_CONFIG
    }


def _from_assignments(assignments: Iterable[str]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for text in assignments:
        key, equals, value = text.partition("=")
        if not equals:
            raise UsageError(f"--set takes key=value, but {text!r} came.")
        head, _, tail = key.strip().partition(".")
        values[head] = _joined(values.get(head), {tail: _literal(value)} if tail else _literal(value))
    return values


def _joined(earlier: Any, later: Any) -> Any:
    """`later`, or both when they are tables: a source may set one entry and leave the others."""
    return {**earlier, **later} if isinstance(earlier, dict) and isinstance(later, dict) else later


def _literal(text: str) -> Any:
    """`text` as a TOML value where the key wants one (numbers, tables), else as it stands."""
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
    return value if isinstance(value, (bool, dict, float, int, list)) else str(value)


def parse_topics(texts: Iterable[str]) -> dict[str, str]:
    """`role=topic` texts as a table.

    Raises:
        UsageError: a text without `=`, or an unknown role.
    """
    roles = ("color", "depth", "pose", "labels")
    table: dict[str, str] = {}
    for text in texts:
        role, equals, name = text.partition("=")
        if not equals or not name:
            raise UsageError(f"--topic takes role=topic, such as color=/camera/image, but {text!r} came.")
        if role not in roles:
            raise UsageError(f"--topic has no role {role!r}{nearest(role, roles)}")
        table[role] = name
    return table
