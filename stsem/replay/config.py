"""What a run was asked to do: one validated model, whatever mixture of file, environment and flags it came from."""

import hashlib
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, JsonValue, field_validator, model_validator

from stsem.replay.modes import Mode, parse_modes
from stsem.replay.queues import parse_queue
from stsem.stages.propagate import AUTO, IN_SPACE, PROPAGATIONS
from stsem.stages.select import parse_policy

_SWITCHES = {"on": True, "yes": True, "true": True, "1": True, "off": False, "no": False, "false": False, "0": False}


def _on_off(value: object) -> bool:
    try:
        return _SWITCHES[str(value).lower()]
    except KeyError:
        raise ValueError("it can be on or off") from None


def _number_as_text(value: object) -> object:
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


LONGEST_S = 1e9
"""No duration is longer: 31 years fit into integer nanoseconds with room to spare."""

PoseSource = Literal["log", "slam"]
Switch = Annotated[bool, BeforeValidator(_on_off)]
Text = Annotated[str, BeforeValidator(_number_as_text)]
Where: dict[str, JsonValue] = {"where": True}
"""Marks fields that say where things come from or go to, or how they are shown: they are not part of the result."""


def _sha256(path: Path) -> str:
    """Of the file's bytes; "" when it cannot be read, which its user will say."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


class RunConfig(BaseModel):
    """Everything that can be configured; every key is also a flag, a TOML key and an environment variable.

    Raises:
        pydantic.ValidationError: a value that cannot be (turned into a sentence by `stsem.replay.settings`).
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mode: str = Field("per-frame,keyframe", description="Modes to run, comma separated, or 'both'.")
    model: str = Field("default", description="Shipped network, a FILE.onnx with its sidecar .toml, or 'oracle'.")
    backend: str = Field("onnxruntime", description="What runs the network: onnxruntime or openvino.")
    precision: str = Field("f32", description="Arithmetic of the network: f32, int8 or (openvino only) bf16.")
    keyframes: str = Field("paper", description="Keyframe policy: 'paper', 'every:N', 'coverage:SHARE' or 'budget:HZ'.")
    keyframe_rotation: float = Field(0.1, gt=0, description="paper: threshold on |H[:2,:2] - I|_F.")
    keyframe_translation: float = Field(0.15, gt=0, description="paper: threshold on |H[:2,2]|, in image widths.")
    keyframe_time_s: float = Field(
        1.0, gt=0, le=LONGEST_S, description="paper, coverage: longest time between keyframes, seconds."
    )
    propagation: str = Field(
        AUTO,
        description="How frames between keyframes are predicted; 'auto': 'depth' where the log has what it takes, "
        "else 'flow'.",
    )
    pose: PoseSource = Field(
        "log", description="Where the camera's pose comes from: the log, or 'slam' on colour and depth."
    )
    map: Switch = Field(True, description="Build the labelled map where there is depth and poses.")
    depth_registered: Literal["auto", "yes", "no"] = Field(
        "auto", description="Whether depth pixels match colour pixels."
    )
    clock: Literal["real-time", "offline"] = Field("real-time", description="Simulated clock, or every frame in order.")
    rate: Text = Field("1", description="Replay speed: 2 plays the log twice as fast on the simulated clock.")
    queue: str = Field("latest", description="What waits for the pipeline: 'latest', 'fifo:N' or 'lossless'.")
    cores: int = Field(2, ge=1, le=64, description="Simulated cores.")
    deadline_ms: float | None = Field(
        None, gt=0, le=1000 * LONGEST_S, description="Deadline from arrival; default the capture period / rate."
    )
    costs: str = Field("auto", description="'auto', 'measured', a profile, or the trace.json of an earlier run.")
    seed: int = Field(0, ge=0, description="Seed of every draw.")
    count_decode: Switch = Field(False, description="Charge decoding to the simulated cores.")
    offline: Switch = Field(True, description="Also measure the accuracy without a clock.")
    sustainable: Switch = Field(False, description="Search for the highest rate that the pipeline sustains.")
    topic: dict[Literal["color", "depth", "pose", "labels"], str] = Field({}, description="Channels to use, by role.")
    start: float | None = Field(
        None, ge=0, le=LONGEST_S, description="Start of the window, seconds from the first colour stamp."
    )
    end: float | None = Field(
        None, gt=0, le=LONGEST_S, description="End of the window, seconds from the first colour stamp, exclusive."
    )
    classes: Path | None = Field(None, description="Class table of the truth.", json_schema_extra=Where)
    class_map: Path | None = Field(None, description="TOML: network class = log class.", json_schema_extra=Where)
    out: Path | None = Field(None, description="Folder for the results.", json_schema_extra=Where)
    annotate: Switch = Field(False, description="Also write annotated.mcap.", json_schema_extra=Where)
    plots: Switch = Field(True, description="Draw the plots.", json_schema_extra=Where)
    cache: Switch = Field(
        True, description="Keep and reuse network outputs and cost profiles.", json_schema_extra=Where
    )
    repeat: int = Field(
        1, ge=1, le=1000, description="Replay N times; fail on any difference.", json_schema_extra=Where
    )
    json_: Switch = Field(False, alias="json", description="Print report.json.", json_schema_extra=Where)

    @field_validator("mode")
    @classmethod
    def _mode_exists(cls, text: str) -> str:
        return ",".join(mode.name for mode in parse_modes(text))

    @field_validator("keyframes")
    @classmethod
    def _policy_exists(cls, text: str) -> str:
        parse_policy(text, rotation=1.0, translation=1.0, time_ns=1)
        return text

    @field_validator("propagation")
    @classmethod
    def _propagation_exists(cls, text: str) -> str:
        if text not in (AUTO, *PROPAGATIONS):
            raise ValueError(f"there is no propagation {text!r}; there is {AUTO}, {', '.join(PROPAGATIONS)}")
        return text

    @field_validator("queue")
    @classmethod
    def _queue_exists(cls, text: str) -> str:
        parse_queue(text)
        return text

    @field_validator("rate")
    @classmethod
    def _rate_is_positive(cls, text: str) -> str:
        try:
            value = Fraction(text)
        except (ValueError, ZeroDivisionError):
            raise ValueError(f"{text!r} is not a number such as 1, 0.5 or 3/2") from None
        if not Fraction(1, 1000) <= value <= 1000:
            raise ValueError(f"{text} is not between 1/1000 and 1000")
        return str(value)

    @model_validator(mode="after")
    def _parts_fit(self) -> "RunConfig":
        if self.end is not None and self.end <= (self.start or 0.0):
            raise ValueError(f"the window ends at {self.end:g} s, not after its start at {self.start or 0.0:g} s")
        if self.sustainable and self.clock == "offline":
            raise ValueError("--sustainable needs the simulated clock, but --clock offline was asked for")
        self._check_coverage()
        return self

    def _check_coverage(self) -> None:
        """Raise ValueError where a policy asks for coverage that nobody could tell."""
        method = PROPAGATIONS[IN_SPACE if self.propagation == AUTO else self.propagation]
        policy = parse_policy(self.keyframes, rotation=1.0, translation=1.0, time_ns=1, covers=method.needs.space)
        if not policy.needs_coverage or all(mode.segments_every_frame for mode in self.modes):
            return
        if not method.covers:
            raise ValueError(
                f"--keyframes {self.keyframes} asks how much a prediction covers, which --propagation "
                f"{self.propagation} cannot tell; choose another propagation, or --keyframes paper, every:N, budget:HZ"
            )
        if self.sustainable:
            raise ValueError(
                f"--sustainable decides keyframes without images, but --keyframes {self.keyframes} asks how much of an "
                "image is covered; choose paper or every:N"
            )

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes to run, in the table's order."""
        return parse_modes(self.mode)

    @property
    def exact_rate(self) -> Fraction:
        """The replay rate as an exact ratio."""
        return Fraction(self.rate)

    @property
    def is_oracle(self) -> bool:
        """Whether the truth plays the network."""
        return self.model == "oracle"

    def reported(self) -> dict[str, Any]:
        """The part of the configuration that results depend on, JSON-able; class files by their sha256."""
        where = {name for name, field in type(self).model_fields.items() if field.json_schema_extra == Where}
        values: dict[str, Any] = self.model_dump(mode="json", exclude=where)
        values["model"] = Path(self.model).name
        values |= {
            name: _sha256(path) for name in ("classes", "class_map") if (path := getattr(self, name)) is not None
        }
        values["costs"] = self.costs if self.costs in ("auto", "measured") else "file"
        return values
