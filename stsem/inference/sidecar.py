"""The TOML file beside an ONNX file: what the numbers going in and the ids coming out mean (DESIGN 11)."""

import difflib
import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeGuard

from stsem.classes import ClassSet
from stsem.errors import ClassTableError, NetworkError

SIGN = "current - previous"
PARTNER = "previous frame"
UNIT = "metres"

_KEYS = ("size", "mean", "std", "classes", "colours", "note", "difference", "depth")
_REQUIRED = ("size", "mean", "std", "classes")
_DIFFERENCE_KEYS = ("sign", "scale", "partner")
_DEPTH_KEYS = ("unit", "scale", "unknown")

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Difference:
    """How the second input is formed: `scale` (current - previous), both RGB in 0..1 at the network's size.

    `previous` is the previous decodable colour frame of the log; for the first frame the difference is zero.
    """

    scale: float


@dataclass(frozen=True)
class DepthForm:
    """How the input `depth` is formed: `scale` times metres along the optical axis, one channel.

    The nearest pixel of the frame's depth is taken, so that edges do not mix.

    Args:
        scale: factor on the metres.
        unknown: what stands where depth is unknown, and all over for a frame without depth.
    """

    scale: float = 1.0
    unknown: float = 0.0


@dataclass(frozen=True)
class Sidecar:
    """What a network expects and returns.

    Args:
        size: (width, height) of its input, pixels.
        mean, std: per RGB channel, in 0..1; the input is (image / 255 - mean) / std.
        classes: ids of its labels.
        difference: how the second input is formed; None for a network with the image alone.
        note: where it comes from; free text.
        depth: how the input of that name is formed; None for a network that does not take depth.
    """

    size: tuple[int, int]
    mean: Triple
    std: Triple
    classes: ClassSet
    difference: Difference | None = None
    note: str = ""
    depth: DepthForm | None = None

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the graph's inputs: the image, and what there is a section for."""
        sections = {"difference": self.difference, "depth": self.depth}
        return ("image", *(name for name, section in sections.items() if section is not None))

    def for_inputs(self, names: Iterable[str]) -> "Sidecar":
        """The same for a network that takes `names`: without the sections it has no use for, and with plain depth."""
        wanted = frozenset(names)
        return replace(
            self,
            difference=self.difference if "difference" in wanted else None,
            depth=(self.depth or DepthForm()) if "depth" in wanted else None,
        )


def parse(text: str, where: str) -> Sidecar:
    """Sidecar from TOML; `where` names the file in messages.

    Raises:
        NetworkError: not TOML, a key is unknown (the nearest valid one is named) or missing, or a value cannot be.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as err:
        raise NetworkError(f"The sidecar {where} is not valid TOML ({err}); mend it there.") from err
    _check_keys(table, _KEYS, where, "")
    for key in _REQUIRED:
        if key not in table:
            raise NetworkError(f"The sidecar {where} has no key {key!r}; it needs {', '.join(_REQUIRED)}.")
    std = _triple(table, "std", where)
    if min(std) <= 0:
        raise NetworkError(f"The sidecar {where} has std = {list(std)}; every value must be above 0.")
    return Sidecar(
        _size(table, where), _triple(table, "mean", where), std, _classes(table, where), _difference(table, where),
        str(table.get("note", "")), _depth(table, where),
    )  # fmt: skip


def render(sidecar: Sidecar) -> str:
    """The TOML that `parse` reads back to an equal sidecar."""
    lines = [
        f"size = {list(sidecar.size)}  # width, height",
        f"mean = {list(sidecar.mean)}  # RGB in 0..1: input = (image / 255 - mean) / std",
        f"std = {list(sidecar.std)}",
        f"classes = {_quoted(sidecar.classes.names)}",
    ]
    if sidecar.classes.colours:
        lines.append(f"colours = {[list(colour) for colour in sidecar.classes.colours]}")
    if sidecar.note:
        lines.append(f"note = {_string(sidecar.note)}")
    if sidecar.difference:
        lines += ["", "[difference]  # RGB in 0..1 at the network's size, zero for the first frame",
                  f'sign = "{SIGN}"', f"scale = {sidecar.difference.scale}", f'partner = "{PARTNER}"']  # fmt: skip
    if sidecar.depth:
        form = sidecar.depth
        lines += ["", "[depth]  # one channel at the network's size, nearest neighbour",
                  f'unit = "{UNIT}"', f"scale = {form.scale}", f"unknown = {form.unknown}"]  # fmt: skip
    return "\n".join(lines) + "\n"


def _quoted(names: Iterable[str]) -> str:
    return "[" + ", ".join(map(_string, names)) + "]"


def _string(text: str) -> str:
    """A TOML basic string: as JSON's, but beyond it DEL must be escaped and surrogate pairs are not allowed."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _check_keys(table: Mapping[str, object], valid: tuple[str, ...], where: str, section: str) -> None:
    for key in table:
        if key not in valid:
            near = difflib.get_close_matches(key, valid, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else f"valid keys are {', '.join(valid)}."
            raise NetworkError(f"The sidecar {where} has an unknown key {key!r}{section}; {hint}")


def _numbers(table: Mapping[str, object], key: str, count: int, where: str) -> list[float]:
    value = table[key]
    if not isinstance(value, list) or len(value) != count or not all(_is_number(item) for item in value):
        raise NetworkError(f"The sidecar {where} has {key} = {value!r}; expected a list of {count} numbers.")
    return value


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _triple(table: Mapping[str, object], key: str, where: str) -> Triple:
    r, g, b = (float(item) for item in _numbers(table, key, 3, where))
    return r, g, b


def _size(table: Mapping[str, object], where: str) -> tuple[int, int]:
    width, height = _numbers(table, "size", 2, where)
    if not all(isinstance(side, int) and side > 0 for side in (width, height)):
        raise NetworkError(f"The sidecar {where} has size = {[width, height]}; expected [width, height] in pixels.")
    return int(width), int(height)


def _classes(table: Mapping[str, object], where: str) -> ClassSet:
    names, colours = table["classes"], table.get("colours", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise NetworkError(f"The sidecar {where} has classes = {names!r}; expected a list of names.")
    if not isinstance(colours, list) or not all(_is_colour(colour) for colour in colours):
        raise NetworkError(
            f"The sidecar {where} has colours = {colours!r}; expected [red, green, blue] per class, 0..255."
        )
    try:
        return ClassSet(tuple(names), tuple((r, g, b) for r, g, b in colours))
    except ClassTableError as err:
        raise NetworkError(f"The sidecar {where} has a class table that cannot be: {err}") from err


def _is_colour(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(type(x) is int and 0 <= x <= 255 for x in value)


def _difference(table: Mapping[str, object], where: str) -> Difference | None:
    section = _section(table, "difference", _DIFFERENCE_KEYS, {"sign": SIGN, "partner": PARTNER}, where)
    return None if section is None else Difference(_factor(section, "difference", "scale", 1.0, where))


def _depth(table: Mapping[str, object], where: str) -> DepthForm | None:
    section = _section(table, "depth", _DEPTH_KEYS, {"unit": UNIT}, where)
    if section is None:
        return None
    return DepthForm(_factor(section, "depth", "scale", 1.0, where), _factor(section, "depth", "unknown", 0.0, where))


def _section(
    table: Mapping[str, object], name: str, keys: tuple[str, ...], fixed: Mapping[str, str], where: str
) -> Mapping[str, object] | None:
    """The table [name], whose keys are among `keys`; those of `fixed` have one valid value each."""
    section = table.get(name)
    if section is None:
        return None
    if not isinstance(section, dict):
        raise NetworkError(f"The sidecar {where} has {name} = {section!r}; expected a table [{name}].")
    _check_keys(section, keys, where, f" in [{name}]")
    for key, expected in fixed.items():
        if section.get(key, expected) != expected:
            raise NetworkError(
                f"The sidecar {where} has {key} = {section[key]!r}; the only {key} known is {expected!r}."
            )
    return section


def _factor(section: Mapping[str, object], name: str, key: str, default: float, where: str) -> float:
    value = section.get(key, default)
    if not _is_number(value):
        raise NetworkError(f"The sidecar {where} has {key} = {value!r} in [{name}]; expected a number.")
    return float(value)
