"""One row of the table: a recording of the scene that differs in one respect, and what must stay equal."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any

from analytic_scene import Scene
from encoders_ros import RosMessages
from made_up_logs import Recorder
from tape import (
    PLAIN_POSE,
    Part,
    Tape,
    calibration,
    class_names,
    color,
    depth,
    ids,
    labels,
    millimetres,
    nothing,
    rgb8,
    together,
)

ROS2 = RosMessages(2)
PLAIN_COLOR, PLAIN_DEPTH, PLAIN_LABELS, PLAIN_CALIBRATION = color(rgb8), depth(millimetres), labels(ids), calibration()
Paths = Sequence[Path | str]
Store = Callable[[Tape, Path], Paths]
"""(what to write, an empty folder) -> what to give to open_log."""


@dataclass(frozen=True)
class Equal:
    """How far a variant may be from the scene, and from the plain recording of it.

    Args:
        color_db: least peak signal-to-noise ratio of an image in dB; infinite: every pixel is the same.
        grey: colour is the scene's green alone, in three channels.
        depth_m: largest error of depth in metres, of `depth_share` of the pixels whose depth the scene knows; 0 and 1:
            the same everywhere, unknown pixels too. None: the frames have no depth.
        labels_share: of the pixels whose label must be the scene's.
        camera, pose: whether frames have intrinsics and poses, those of the scene; poses to a nanometre.
        map: whether the labelled cloud has the same points and classes (and colours, where they are exact).
        timing: "same": every number of the run is; "shifted": all but latencies, as log times have another delay that
            is the same for all frames; "other": only what needs no clock, as log times are changed on purpose.
        pixels: label pixels for each of the plain recording's.
        scores: largest difference of a score; 0: the same to the last bit.
        warns: beginnings of the warnings that there must be; no others may be there.
    """

    color_db: float = inf
    grey: bool = False
    depth_m: float | None = 0.0
    depth_share: float = 1.0
    labels_share: float = 1.0
    camera: bool = True
    pose: bool = True
    map: bool = True
    timing: str = "same"
    pixels: int = 1
    scores: float = 0.0
    warns: tuple[str, ...] = ()

    def __str__(self) -> str:
        """For the table of docs/logs.md."""
        clock = {"same": "scores and timing", "shifted": "scores", "other": "offline scores"}[self.timing]
        parts = [f"scores within {self.scores:g}" if self.scores else clock]
        parts += ["map"] if self.map else []
        parts += ["colour is grey"] if self.grey else []
        parts += [f"colour {self.color_db:g} dB"] if self.color_db < inf else []
        if self.depth_m:
            share = f" for {self.depth_share:.0%}" if self.depth_share < 1 else ""
            parts.append(f"depth within {1000 * self.depth_m:g} mm{share}")
        parts += [f"{self.labels_share:.0%} of labels"] if self.labels_share < 1 else []
        absent = {"depth": self.depth_m is None, "intrinsics": not self.camera, "poses": not self.pose}
        return "; ".join([*parts, *(f"no {name}" for name, lacks in absent.items() if lacks)])


def one_file(name: str = "log.mcap", **options: Any) -> Store:
    """A file by mcap's writer, of a few chunks."""

    def store(tape: Tape, folder: Path) -> Paths:
        return [write(tape, folder / name, **({"chunk_size": 1 << 16} | options))]

    return store


def write(tape: Tape, path: Path, **options: Any) -> Path:
    """`tape` by mcap's writer."""
    log = Recorder(path, **options)
    for name, table in tape.metadata.items():
        log.writer.add_metadata(name, dict(table))
    for message in tape.messages:
        log.put(message.topic, message.content, message.log_ns)
    for name, data in tape.attachments.items():
        log.writer.add_attachment(0, 0, name, "application/octet-stream", data)
    return log.close()


ONE_FILE = one_file()


@dataclass(frozen=True)
class Variant:
    """A recording of the scene.

    Args:
        name, how: what it is called, and how it differs, for people; rows of docs/logs.md.
        make: encoders of its family.
        scene: what is recorded.
        color, depth, calibration, pose, labels, classes, more: its parts.
        change: what is done to the tape, which is in order of log time.
        store: what writes it.
        reach: from what was written to what is opened.
        opened: arguments of open_log.
        classes_file: name and content of a class table to give along.
        equal: what must stay.
    """

    name: str
    how: str
    make: Any = ROS2
    scene: Scene = Scene()  # noqa: RUF009  never changed
    color: Part = PLAIN_COLOR
    depth: Part = PLAIN_DEPTH
    calibration: Part = PLAIN_CALIBRATION
    pose: Part = PLAIN_POSE
    labels: Part = PLAIN_LABELS
    classes: Part = class_names
    more: Part = nothing
    change: Callable[[Tape], Tape] = lambda tape: tape
    store: Store = ONE_FILE
    reach: Callable[[Paths], AbstractContextManager[Paths]] = nullcontext
    opened: Mapping[str, Any] = field(default_factory=dict)
    classes_file: tuple[str, str] | None = None
    equal: Equal = Equal()

    def written(self, folder: Path) -> Paths:
        """Write it; returns what there is to open."""
        parts = self.classes, self.calibration, self.pose, self.color, self.depth, self.labels, self.more
        return self.store(self.change(together(*parts)(self.make, self.scene).sorted()), folder)


def rows(variants: Iterable[Variant], **same: Any) -> tuple[Variant, ...]:
    """`variants`, all with `same`."""
    return tuple(replace(variant, **same) for variant in variants)
