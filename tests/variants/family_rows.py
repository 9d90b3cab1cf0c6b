"""Schema families, and how recorders spell their types."""

from collections.abc import Callable
from dataclasses import replace

from encoders_foxglove import Fox, Json
from encoders_ros import Encoded, RosMessages
from image_messages import encoded
from tape import COLOR, DEPTH, LABELS, Tape, color, depth, labels
from variant import Variant

ROS1, FOX, JSON = RosMessages(1), Fox(), Json()
COMPRESSED = {
    "color": color(
        lambda make, t, view: make.compressed(t, encoded(".png", view.rgb), "png"), f"{COLOR}/compressed"
    ),
    "depth": depth(lambda make, t, view: make.compressed(t, encoded(".png", view.mm), "png"), f"{DEPTH}/compressed"),
    "labels": labels(lambda make, t, view: make.compressed(t, encoded(".png", view.labels), "png"), f"{LABELS}/png"),
}  # fmt: skip
"""Everything as png, which every family has."""


def respelled(respell: Callable[[Encoded], Encoded]) -> Callable[[Tape], Tape]:
    """A change of what every channel says about its messages."""

    def change(tape: Tape) -> Tape:
        messages = (replace(message, content=respell(message.content)) for message in tape.messages)
        return replace(tape, messages=tuple(messages))

    return change


def _dds(content: Encoded) -> Encoded:
    package, _, name = content.schema.split("/")
    return replace(content, schema=f"{package}::msg::dds_::{name}_", schema_encoding="ros2idl", definition=b"")


FAMILIES = (
    Variant("plain", "ROS 2 (cdr), raw images, tf, LabelInfo, zstd chunks: what all others are compared with"),
    Variant("ros2-big-endian", "ROS 2 messages in big-endian CDR", make=RosMessages(2, little_endian=False)),
    Variant("ros1", "ROS 1 messages (ros1msg)", make=ROS1),
    Variant("protobuf", "foxglove messages in protobuf, classes as metadata", make=FOX),
    Variant("json", "foxglove messages in JSON, bytes in base64", make=JSON),
    *(
        Variant(f"{name}-compressed", f"all images as png in {spelled}", make=make, **COMPRESSED)
        for name, spelled, make in (
            ("ros2", "ROS 2", RosMessages(2)), ("ros1", "ROS 1", ROS1), ("protobuf", "foxglove protobuf", FOX),
            ("json", "foxglove JSON", JSON),
        )
    ),
    Variant("ros2-types-of-ros1", "ROS 2 types without `msg/` in their names", change=respelled(
        lambda content: replace(content, schema=content.schema.replace("/msg/", "/")))),
    Variant("ros2-types-of-dds", "types in the spelling of DDS, definitions in IDL", change=respelled(_dds)),
    Variant("ros2-no-definitions", "schemas without a definition", change=respelled(
        lambda content: replace(content, schema_encoding="", definition=b""))),
)  # fmt: skip
