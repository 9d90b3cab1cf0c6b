"""Which calibration belongs to an image channel, and what follows from it: a pinhole camera, and straight pixels."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from stsem.camera import Camera
from stsem.classes import Labels
from stsem.frame import Depth, Image
from stsem.geometry.undistort import Undistortion
from stsem.log.candidate import Candidate
from stsem.log.choose import choose_calibration
from stsem.log.prefetch import Recent
from stsem.log.remark import Remark
from stsem.log.schemas.messages import Calibration
from stsem.log.topicnames import RECTIFIED_WORDS
from stsem.log.tracks import Track

SIZES_KEPT = 2
SHAPE_TOLERANCE = 0.01
Size = tuple[int, int]


class Rectifier:
    """Undoes the lens distortion of one camera's images, and of labels and depth of any size on the same pixels.

    Args:
        camera: as the images are sent; None, or one without distortion, leaves everything as it is.

    Raises:
        ValueError: distortion that cannot be undone; the text is the middle of a sentence.
    """

    def __init__(self, camera: Camera | None = None) -> None:
        self._camera = camera if camera and camera.is_distorted else None
        self._undistortions: Recent[Size, Undistortion] = Recent(self._prepare, SIZES_KEPT)
        if self._camera:
            self._undistortions.get((self._camera.width, self._camera.height))

    def image(self, image: Image) -> Image:
        """(H, W, 3) uint8; black where the lens did not see."""
        return self._of_size(image.shape).image(image) if self._camera else image

    def labels(self, labels: Labels) -> Labels:
        """(H, W) uint8; 255 where the lens did not see."""
        return self._of_size(labels.shape).labels(labels) if self._camera else labels

    def depth(self, depth: Depth) -> Depth:
        """(H, W) float32 metres; NaN where the lens did not see."""
        return self._of_size(depth.shape).depth(depth) if self._camera else depth

    def _of_size(self, shape: tuple[int, ...]) -> Undistortion:
        return self._undistortions.get((shape[1], shape[0]))

    def _prepare(self, size: Size) -> Undistortion:
        if self._camera is None:
            raise ValueError("there is no distortion to undo")
        return Undistortion(self._camera.scaled(*size))


@dataclass(frozen=True, eq=False)
class Optics:
    """What is known of the camera behind an image channel.

    Args:
        track: the calibration channel; None without one.
        camera: pinhole camera of the images after `rectifier`; None when there is no calibration that can be used.
        rectifier: undoes the distortion.
        straight: whether the images are without distortion as they are sent.
        warnings: one sentence each.
    """

    track: Track | None = None
    camera: Camera | None = None
    rectifier: Rectifier = Rectifier()  # noqa: RUF009  it changes nothing and is never changed
    straight: bool = True
    warnings: tuple[str, ...] = ()


def color_optics(
    tracks: Sequence[Track], images: Sequence[Candidate], color: Candidate, size: Size, depth: Candidate | None
) -> Optics:
    """Optics of the colour camera.

    Args:
        tracks: all of the log.
        images: all image channels.
        color: the colour camera's.
        size: (width, height) of its images.
        depth: the channel of depth on the same pixels, whose calibration serves where colour has none.
    """
    track = choose_calibration(tracks, color)
    owner = next((image for image in images if track and image is not color and belongs(track, image)), None)
    if track and (not owner or belongs(track, color)):
        return read_optics(track, color, size)
    shared = choose_calibration([track for track in tracks if depth and belongs(track, depth)], depth or color)
    if shared and depth:
        optics = read_optics(shared, color, size)
        sentence = f"{color.topic} has no calibration; that of {depth.topic}, registered to it, serves."
        return replace(optics, warnings=(Remark("intrinsics-borrowed", sentence), *optics.warnings))
    if track and owner:
        sentence = f"{track.topic} is the calibration of {owner.topic}; {color.topic} has none: no intrinsics."
        return Optics(warnings=(Remark("intrinsics-missing", sentence),))
    return Optics()


def own_optics(tracks: Iterable[Track], image: Candidate, size: Size) -> Optics:
    """Optics by the channel's own calibration, and no other's, for images of `size` (width, height)."""
    track = choose_calibration([track for track in tracks if belongs(track, image)], image)
    return read_optics(track, image, size) if track else Optics()


def belongs(track: Track, image: Candidate) -> bool:
    """Whether a calibration is that of an image channel: the same frame, or below the same topic."""
    if not track.calibrations:
        return False
    parts = tuple(part for part in track.topic.split("/") if part)
    frame_id = track.calibrations[0].frame_id
    below = bool(image.base) and parts[: len(image.base)] == image.base
    return below or (bool(frame_id) and frame_id == image.look.frame_id)


def read_optics(track: Track, image: Candidate, size: Size) -> Optics:
    """What calibration `track` says of the images of a channel, which have `size` (width, height)."""
    rectified = bool(image.words & RECTIFIED_WORDS)
    camera = next((found for c in track.calibrations if (found := _camera(c, rectified))), None)
    if camera is None:
        sentence = f"{track.topic} says that the camera is uncalibrated (K is zero): no intrinsics."
        return Optics(track, warnings=(Remark("intrinsics-zero", sentence),))
    warnings: list[str] = []
    if track.changes:
        sentence = f"{track.topic} changes {track.changes} times; the first calibration is used."
        warnings.append(Remark("intrinsics-change", sentence))
    if rectified and any(c.camera and c.camera.is_distorted for c in track.calibrations):
        sentence = (
            f"{image.topic} is rectified, by its name: the lens distortion that {track.topic} states is not undone."
        )
        warnings.append(Remark("distortion-gone", sentence))
    camera, scaled = _for_size(camera, size, track.topic)
    optics = _straighten(track, camera)
    return replace(optics, warnings=(*warnings, *scaled, *optics.warnings))


def _camera(calibration: Calibration, rectified: bool) -> Camera | None:
    """The camera of the images as they were sent."""
    if not rectified:
        return calibration.camera
    if calibration.rectified or calibration.camera is None:
        return calibration.rectified
    return replace(calibration.camera, distortion=(), model="")


def _for_size(camera: Camera, size: Size, topic: str) -> tuple[Camera, list[str]]:
    if camera.width <= 0 or camera.height <= 0:
        return replace(camera, width=size[0], height=size[1]), []
    if (camera.width, camera.height) == size:
        return camera, []
    sentence = (
        f"{topic} is for {camera.width}x{camera.height}, the images are {size[0]}x{size[1]}: intrinsics are scaled"
    )
    if same_shape((camera.width, camera.height), size):
        return camera.scaled(*size), [Remark("intrinsics-scaled", f"{sentence}.")]
    sentence += ", though the shape differs: if the images were cropped, depth and map are off."
    return camera.scaled(*size), [Remark("intrinsics-shape", sentence)]


def _straighten(track: Track, camera: Camera) -> Optics:
    if not camera.is_distorted:
        return Optics(track, camera)
    try:
        rectifier = Rectifier(camera)
    except ValueError as err:
        sentence = f"The lens distortion that {track.topic} states cannot be undone ({err}): no intrinsics, no map."
        return Optics(track, straight=False, warnings=(Remark("distortion-unknown", sentence),))
    pinhole = replace(camera, distortion=(), model="")
    sentence = f"The lens distortion that {track.topic} states ({camera.model}) is undone."
    return Optics(track, pinhole, rectifier, straight=False, warnings=(Remark("distortion-undone", sentence),))


def same_shape(a: Size, b: Size) -> bool:
    """Whether two sizes (width, height) have the same ratio of sides, up to rounding."""
    return abs(a[0] * b[1] - b[0] * a[1]) <= SHAPE_TOLERANCE * a[0] * b[1]
