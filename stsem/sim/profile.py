"""Cost profiles: how long each stage takes on a machine, as a published JSON file.

    {"schema": "stsem-costs/1", "machine": "...", "disturbed": false, "made_for": {...},
     "samples_ns": {"segment@2": [...], ...}}

A key is `stage@cores`. Samples are positive integers of nanoseconds; their order in the file means nothing.
"""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from stsem.errors import CostError, OutputError

SCHEMA = "stsem-costs/1"
LONGEST_NS = 86_400 * 10**9


def key(stage: str, cores: int) -> str:
    """The name of a stage's samples in a profile: `stage@cores`."""
    return f"{stage}@{cores}"


@dataclass(frozen=True)
class CostProfile:
    """Measured durations of the stages on one machine.

    Args:
        machine: which one, in words.
        samples_ns: `stage@cores` -> ascending durations in nanoseconds, at least one each.
        disturbed: whether other work held a core during too many of the measurements; reports say so.
        made_for: what it was measured with, e.g. network, image size and backend; text for the reader.
    """

    machine: str
    samples_ns: Mapping[str, tuple[int, ...]]
    disturbed: bool = False
    made_for: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.samples_ns:
            raise CostError("A cost profile needs samples of at least one stage; make one with `stsem costs measure`.")
        for name, samples in self.samples_ns.items():
            _check_samples(name, samples)
        ordered = {name: tuple(sorted(self.samples_ns[name])) for name in sorted(self.samples_ns)}
        object.__setattr__(self, "samples_ns", ordered)
        object.__setattr__(self, "made_for", dict(sorted(self.made_for.items())))

    def samples(self, stage: str, cores: int) -> tuple[int, ...]:
        """Ascending samples of `stage` on `cores`, in nanoseconds.

        Raises:
            CostError: there are none.
        """
        found = self.samples_ns.get(key(stage, cores))
        if found is None:
            raise CostError(
                f"The cost profile has no '{key(stage, cores)}', only {', '.join(self.samples_ns)}; "
                "measure it with `stsem costs measure`."
            )
        return found

    def distinct_samples_of_slowest(self, keys: Collection[str]) -> int:
        """Distinct samples of the stage with the largest median among `keys`: a bound for percentiles (DESIGN 5)."""
        present = [self.samples_ns[k] for k in keys if k in self.samples_ns]
        if not present:
            return 0
        slowest = max(present, key=_median)
        return len(set(slowest))

    def scaled(self, factors: Mapping[str, Fraction], default: Fraction = Fraction(1)) -> "CostProfile":
        """A profile for another machine: every sample times its factor, rounded half to even, at least 1 ns.

        Args:
            factors: by `stage@cores` or by `stage`; the longer name wins.
            default: for every other stage.

        Raises:
            CostError: a factor is not positive, or names a stage that the profile lacks.
        """
        known = {*self.samples_ns, *(k.rpartition("@")[0] for k in self.samples_ns)}
        for name, factor in (*factors.items(), ("every other stage", default)):
            if factor <= 0:
                raise CostError(
                    f"The factor of '{name}' is {factor}, but a duration can only be scaled by more than 0."
                )
        if unknown := sorted(set(factors) - known):
            raise CostError(f"The profile has no stage '{unknown[0]}' to scale, only {', '.join(self.samples_ns)}.")
        scaled = {}
        for name, samples in self.samples_ns.items():
            factor = factors.get(name, factors.get(name.rpartition("@")[0], default))
            scaled[name] = tuple(max(1, round(sample * factor)) for sample in samples)
        parts = [f"{name} x {factor}" for name, factor in sorted(factors.items())]
        words = ", ".join([*parts, f"{'the rest ' if parts else ''}x {default}"])
        return CostProfile(f"{self.machine}, scaled {words}", scaled, self.disturbed, self.made_for)

    def to_bytes(self) -> bytes:
        """The file: JSON, keys sorted, samples ascending, a stage per line; equal profiles have equal bytes."""
        head = {"schema": SCHEMA, "machine": self.machine, "disturbed": self.disturbed, "made_for": self.made_for}
        lines = [f"  {_json(name)}: {_json(value)}," for name, value in head.items()]
        rows = [f"    {_json(name)}: {_json(samples)}" for name, samples in self.samples_ns.items()]
        body = ",\n".join(rows)
        return ("{\n" + "\n".join(lines) + '\n  "samples_ns": {\n' + body + "\n  }\n}\n").encode()

    @property
    def sha256(self) -> str:
        """Digest of `to_bytes`: the `costs_sha256` of a report."""
        return hashlib.sha256(self.to_bytes()).hexdigest()

    def save(self, path: Path) -> None:
        """Write the profile.

        Raises:
            OutputError: `path` cannot be written.
        """
        try:
            path.write_bytes(self.to_bytes())
        except OSError as err:
            raise OutputError(
                f"The cost profile cannot be written to {path}: {err.strerror}; choose another path."
            ) from err


def load_profile(path: Path) -> CostProfile:
    """Read a profile.

    Raises:
        CostError: the file cannot be read, or is not a cost profile.
    """
    try:
        data = path.read_bytes()
    except OSError as err:
        raise CostError(f"The cost profile {path} cannot be read: {err.strerror}; give a file that exists.") from err
    return parse_profile(data, str(path))


def parse_profile(data: bytes, name: str) -> CostProfile:
    """A profile from the bytes of its file.

    Args:
        data: JSON.
        name: what to call it in errors.

    Raises:
        CostError: it is not a cost profile.
    """
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as err:
        raise CostError(f"{name} is not a cost profile: it is not JSON ({err}).") from err
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        found = document.get("schema") if isinstance(document, dict) else type(document).__name__
        raise CostError(f'{name} is not a cost profile: expected "schema": {_json(SCHEMA)}, but found {found!r}.')
    try:
        return _from_document(document)
    except CostError as err:
        raise CostError(f"{name}: {err}") from err


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a profile, as published in docs/cost-profile.schema.json."""
    samples = {"type": "array", "minItems": 1, "items": {"type": "integer", "minimum": 1}}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "stsem cost profile",
        "description": "How long each stage of the pipeline takes on a machine, in nanoseconds; key = stage@cores.",
        "type": "object",
        "required": ["schema", "machine", "samples_ns"],
        "additionalProperties": False,
        "properties": {
            "schema": {"const": SCHEMA},
            "machine": {"type": "string"},
            "disturbed": {"type": "boolean", "default": False},
            "made_for": {"type": "object", "additionalProperties": {"type": "string"}},
            "samples_ns": {
                "type": "object",
                "minProperties": 1,
                "patternProperties": {"^[^@]+@[1-9][0-9]*$": samples},
                "additionalProperties": False,
            },
        },
    }


def _from_document(document: dict[str, Any]) -> CostProfile:
    known = json_schema()["properties"]
    if unknown := sorted(set(document) - set(known)):
        raise CostError(f"The key '{unknown[0]}' is none of {', '.join(known)}.")
    machine, disturbed = document.get("machine"), document.get("disturbed", False)
    samples, made_for = document.get("samples_ns"), document.get("made_for", {})
    if not isinstance(machine, str) or not isinstance(disturbed, bool):
        raise CostError("'machine' must be a text and 'disturbed' true or false.")
    if not isinstance(made_for, dict) or not all(isinstance(value, str) for value in made_for.values()):
        raise CostError("'made_for' must map names to texts.")
    if not isinstance(samples, dict) or not all(isinstance(value, list) for value in samples.values()):
        raise CostError("'samples_ns' must map stage@cores to lists of nanoseconds.")
    return CostProfile(machine, {name: tuple(values) for name, values in samples.items()}, disturbed, made_for)


def _check_samples(name: str, samples: tuple[int, ...]) -> None:
    stage, _, cores = name.rpartition("@")
    if not stage or "@" in stage or not (cores.isascii() and cores.isdigit()) or cores.startswith("0"):
        raise CostError(f"The key '{name}' is not of the form stage@cores, like 'segment@2'.")
    if not samples or any(type(sample) is not int or sample < 1 for sample in samples):
        raise CostError(f"The samples of '{name}' must be integers of at least 1 ns, and at least one.")
    if max(samples) > LONGEST_NS:
        raise CostError(f"The samples of '{name}' reach {max(samples):.2g} ns, but a job lasts a day at most.")


def _median(samples: tuple[int, ...]) -> int:
    return samples[len(samples) // 2]


def _json(value: Any) -> str:
    return json.dumps(dict(value) if isinstance(value, Mapping) else value, sort_keys=True)
