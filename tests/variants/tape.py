"""What is recorded, before it is written: messages in their order, metadata and attachments; and the plain recording
that every variant differs from in one respect."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from analytic_scene import BASE_CAMERA, CLASSES, Scene, View, link
from encoders_ros import NS, Encoded, Link, RosMessages
from mcap.records import Schema

from stsem.pose import Pose

COLOR, DEPTH, LABELS = "/cam/color/image_raw", "/cam/depth/image_raw", "/gt/labels"
INFO, LABEL_INFO, TF, TF_STATIC = "/cam/color/camera_info", "/gt/label_info", "/tf", "/tf_static"
FRAME = "camera"
POSE_LATE_NS, INFO_LATE_NS, COLOR_LATE_NS, DEPTH_LATE_NS, LABELS_LATE_NS = (
    ms * 1_000_000 for ms in (2, 4, 5, 6, 20)
)  # fmt: skip
"""Log time minus stamp."""


@dataclass(frozen=True)
class Message:
    """A message and its log time."""

    topic: str
    content: Encoded
    log_ns: int


@dataclass(frozen=True)
class Tape:
    """What a file will hold."""

    messages: tuple[Message, ...] = ()
    metadata: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    attachments: Mapping[str, bytes] = field(default_factory=dict)

    def __add__(self, other: "Tape") -> "Tape":
        return Tape(
            self.messages + other.messages, {**self.metadata, **other.metadata},
            {**self.attachments, **other.attachments},
        )  # fmt: skip

    def sorted(self) -> "Tape":
        """In order of log time, as recorders write."""
        ordered = sorted(self.messages, key=lambda message: message.log_ns)
        return Tape(tuple(ordered), self.metadata, self.attachments)


Part = Callable[[Any, Scene], Tape]
"""(encoders of a family, scene) -> one part of the recording."""
Draw = Callable[[Any, int, View], Encoded]
"""(encoders, stamp, view) -> an image message."""


def images(topic: str, late_ns: int, draw: Draw, *, only_labelled: bool = False) -> Part:
    """One message a frame."""

    def part(make: Any, scene: Scene) -> Tape:
        kept = [i for i in range(scene.frames) if scene.has_truth(i) or not only_labelled]
        stamps = [scene.stamp_ns(i) for i in kept]
        drawn = (draw(make, stamp, scene.views[i]) for i, stamp in zip(kept, stamps, strict=True))
        return Tape(tuple(Message(topic, m, stamp + late_ns) for m, stamp in zip(drawn, stamps, strict=True)))

    return part


def color(draw: Draw, topic: str = COLOR) -> Part:
    """Colour images."""
    return images(topic, COLOR_LATE_NS, draw)


def depth(draw: Draw, topic: str = DEPTH) -> Part:
    """Depth images."""
    return images(topic, DEPTH_LATE_NS, draw)


def labels(draw: Draw, topic: str = LABELS) -> Part:
    """Label images of the frames with truth."""
    return images(topic, LABELS_LATE_NS, draw, only_labelled=True)


def calibration(topic: str = INFO, **said: Any) -> Part:
    """A calibration with every frame; `said` replaces what the scene's camera says."""

    def part(make: Any, scene: Scene) -> Tape:
        camera, stamps = scene.camera, [scene.stamp_ns(i) for i in range(scene.frames)]
        about = {"width": camera.width, "height": camera.height, "k": camera.K.ravel().tolist(), "frame_id": FRAME}
        if camera.is_distorted:
            about |= {"d": camera.distortion, "model": camera.model}
        about |= said
        return Tape(tuple(Message(topic, make.camera_info(stamp, **about), stamp + INFO_LATE_NS) for stamp in stamps))

    return part


def moving(
    topic: str, say: Callable[[Any, int, Pose], Encoded], offset: Pose = BASE_CAMERA, *, late_ns: int = POSE_LATE_NS
) -> Part:
    """A pose around every image: T_W_base followed by `offset`."""

    def part(make: Any, scene: Scene) -> Tape:
        return Tape(tuple(Message(topic, say(make, t, pose @ offset), t + late_ns) for t, pose in scene.samples))

    return part


def static(*links: Link, topic: str = TF_STATIC) -> Part:
    """Transforms that hold always, published once before everything else."""

    def part(make: Any, scene: Scene) -> Tape:
        early = scene.start_ns - NS
        return Tape((Message(topic, make.tf(early, links), early + POSE_LATE_NS),))

    return part


def together(*parts: Part) -> Part:
    """All of `parts`."""
    return lambda make, scene: sum((part(make, scene) for part in parts), Tape())


def nothing(_make: Any, _scene: Scene) -> Tape:
    """No such channel."""
    return Tape()


def rgb8(make: Any, stamp_ns: int, view: View) -> Encoded:
    """The plain colour image."""
    return make.image(stamp_ns, view.rgb, "rgb8")


def millimetres(make: Any, stamp_ns: int, view: View) -> Encoded:
    """The plain depth image."""
    return make.image(stamp_ns, view.mm.astype("<u2"), "16UC1")


def ids(make: Any, stamp_ns: int, view: View) -> Encoded:
    """The plain label image."""
    return make.image(stamp_ns, view.labels, "mono8")


def base_transform(make: Any, stamp_ns: int, pose: Pose) -> Encoded:
    """world -> base on tf."""
    return make.tf(stamp_ns, [link("world", "base", pose)])


PLAIN_POSE = together(static(link("base", FRAME, BASE_CAMERA)), moving(TF, base_transform, np.eye(4)))


def class_names(make: Any, scene: Scene) -> Tape:
    """The class table as the family has it: a LabelInfo message, or metadata where there is none."""
    names = dict(enumerate(CLASSES))
    if isinstance(make, RosMessages):
        early = scene.start_ns - NS
        return Tape((Message(LABEL_INFO, make.label_info(early, names), early + POSE_LATE_NS),))
    return class_metadata({str(i): name for i, name in names.items()})(make, scene)


def class_metadata(table: Mapping[str, str]) -> Part:
    """The class table as the metadata record of stsem."""
    return lambda make, scene: Tape(metadata={"stsem.classes": table})


def schema_of(content: Encoded, number: int) -> Schema:
    """A schema record of its own number."""
    return Schema(id=number, name=content.schema, encoding=content.schema_encoding, data=content.definition)
