"""Where the numbers come from: the log, the installation, and the host that ran it."""

from pydantic import Field, JsonValue

from stsem.document.part import Count, Number, Part


class Channel(Part):
    """One channel of the log and what it was used as."""

    topic: str
    """Topic in the log."""
    messages: Count = 0
    """Messages on it."""
    schema_name: str = ""
    """Schema as the log names it."""
    offset_ms: Number = None
    """Smallest log time - stamp on this channel, ms; null without stamps."""
    offset_removed: bool = False
    """Whether that offset was taken out, because it is below 0 or above 1 s."""


class LogInput(Part):
    """One log: what it is and what it holds."""

    name: str
    """File or folder name without its path."""
    sha256: str
    """sha256 of the log's bytes, in the order of its files."""
    frames: Count
    """Colour frames in the log, or in the window."""
    frames_with_truth: Count = 0
    """How many of them carry truth."""
    duration_s: Number = None
    """Last minus first colour stamp, seconds."""
    damage: dict[str, JsonValue] = Field(default_factory=dict)
    """What is wrong with the file: `lossy`, and `counts` by kind and channel, which are empty when nothing is."""
    period_ms: Number = None
    """Median capture period of the colour frames, ms."""
    size: tuple[int, int] | None = None
    """Width and height of the colour image in pixels."""
    truth_size: tuple[int, int] | None = None
    """Width and height at which answers are scored."""
    channels: dict[str, Channel] = Field(default_factory=dict)
    """Role (`color`, `depth`, `pose`, `labels`, `camera`) -> channel used for it."""
    window_s: tuple[Number, Number] | None = None
    """`--start` and `--end` in seconds from the first colour stamp, half-open; null for the whole log."""


class Input(Part):
    """What was replayed."""

    logs: tuple[LogInput, ...]
    """The logs; parts of one split recording are one log."""
    classes: tuple[str, ...] = ()
    """Classes of the answers in the order of their ids: the log's, or the network's where the log's cannot be used."""
    colours: tuple[tuple[int, int, int], ...] = ()
    """RGB 0..255 of each class for pictures; empty where nobody gave any."""
    classes_unknown_to_network: tuple[str, ...] = ()
    """Truth classes that the network does not know: all their pixels are wrong."""


class Identity(Part):
    """What must be the same for the bytes to be the same."""

    backend: str = ""
    """What ran the network: `onnxruntime`, or `oracle` for the truth as a perfect network."""
    precision: str = ""
    """`f32`, `bf16` or `int8`."""
    versions: dict[str, str] = Field(default_factory=dict)
    """Package -> version, `stsem` and `python` included."""
    cpu_features: tuple[str, ...] = ()
    """Vector features of the CPU that decide the network's rounding."""
    model: str = ""
    """Name of the network, or `oracle`."""
    model_inputs: tuple[str, ...] = ()
    """What the network is given: `image`, `difference` to the previous frame, `depth`; empty for the oracle."""
    model_sha256: str | None = None
    """sha256 of the ONNX file; null for the oracle."""
    sidecar_sha256: str | None = None
    """sha256 of the network's sidecar; null for the oracle."""
    costs: str = ""
    """Name of the cost profile: where job durations come from."""
    costs_sha256: str | None = None
    """sha256 of the cost profile; null for durations measured as they came."""
    costs_disturbed: bool = False
    """Whether the profile was measured while other work held a core."""


class StageCost(Part):
    """Measured wall-clock cost of one stage on this host."""

    mean_ms: Number = None
    """Mean over `n` runs, ms."""
    max_ms: Number = None
    """Largest, ms."""
    n: Count = 0
    """Number of runs."""


class Host(Part):
    """What differs from run to run and enters no digest."""

    paths: dict[str, str] = Field(default_factory=dict)
    """Name (`log`, `model`, `costs`, `out`) -> path on this host."""
    command: str = ""
    """The command that made this report."""
    machine: dict[str, str] = Field(default_factory=dict)
    """Processor, cores, memory, system, as text."""
    started_at: str = ""
    """UTC, ISO 8601."""
    wall_s: Number = None
    """Wall-clock time of the command, seconds."""
    cpu_s: Number = None
    """CPU time of the command, all threads, seconds."""
    stages: dict[str, StageCost] = Field(default_factory=dict)
    """Stage -> its wall-clock cost while this report was made; for a look, never gated."""
    overhead_ms: Number = None
    """Harness time per frame outside the stages (reading, decoding, clock, metrics), ms."""
    peak_memory_bytes: Count | None = None
    """Largest resident set of the process, bytes."""
