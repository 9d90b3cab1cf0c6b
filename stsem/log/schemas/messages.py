"""Messages after decoding, the same whatever family they came from. Stamps are None where the sensor gave none."""

from dataclasses import dataclass
from enum import Enum, auto

from stsem.camera import Camera


class Kind(Enum):
    """What a channel's schema holds."""

    IMAGE = auto()
    COMPRESSED = auto()
    VIDEO = auto()
    CALIBRATION = auto()
    TRANSFORMS = auto()
    POSE = auto()
    CLASS_TABLE = auto()

    @property
    def is_image(self) -> bool:
        """Whether such messages hold pixels, in whatever form."""
        return self in (Kind.IMAGE, Kind.COMPRESSED, Kind.VIDEO)


@dataclass(frozen=True, eq=False)
class RawImage:
    """An uncompressed image; `data` is a view into the chunk and has `step` bytes per row."""

    stamp_ns: int | None
    frame_id: str
    width: int
    height: int
    encoding: str
    big_endian: bool
    step: int
    data: memoryview


@dataclass(frozen=True, eq=False)
class CompressedImage:
    """A still image in a file format of its own, as `format` tells or ought to tell."""

    stamp_ns: int | None
    frame_id: str
    format: str
    data: memoryview


@dataclass(frozen=True)
class Calibration:
    """Intrinsics of the images as they were sent: after region of interest and binning.

    Args:
        stamp_ns, frame_id: of the message; the frame without the slash of ROS 1, as in transforms.
        camera: of the image as the sensor saw it, with its lens distortion; None when the message says that the camera
            is uncalibrated (K is zero).
        rectified: of the image after rectification (the left 3x3 of P), without distortion; None without a P.
    """

    stamp_ns: int | None
    frame_id: str
    camera: Camera | None
    rectified: Camera | None = None

    def same_as(self, other: "Calibration") -> bool:
        """Whether both say the same of the camera, whenever they do."""
        return (self.camera, self.rectified) == (other.camera, other.rectified)


@dataclass(frozen=True)
class Transform:
    """T_parent_child: maps points of `child` into `parent`, metres; quaternion x, y, z, w.

    A pose has the frame of its header as parent and, unless it is odometry that names it, "" as child.
    """

    stamp_ns: int | None
    parent: str
    child: str
    translation: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


@dataclass(frozen=True)
class ClassNames:
    """A class table that came as a message: raw id -> name."""

    stamp_ns: int | None
    names: dict[int, str]

    def same_as(self, other: "ClassNames") -> bool:
        """Whether both name the same classes, whenever they do."""
        return self.names == other.names


Decoded = RawImage | CompressedImage | Calibration | tuple[Transform, ...] | ClassNames
