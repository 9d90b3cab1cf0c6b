"""Rendered logs: an office, a walk through it, a camera's faults, and the file."""

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from stsem import chance
from stsem.camera import Camera
from stsem.classes import Labels
from stsem.errors import UsageError
from stsem.frame import Depth, Image
from stsem.log.writer import LogWriter
from stsem.pose import Pose
from stsem.synth.path import pose_at, profile, walk
from stsem.synth.scene import Scene
from stsem.synth.sensor import check_noise, expose, kinect, millimetres
from stsem.synth.view import View
from stsem.synth.vocabulary import OFFICE

START_NS = 1_700_000_000 * 10**9
FOCAL_PER_WIDTH = 0.58
_DELAYS_NS = {"calibration": (800_000, 1_600_000), "pose": (1_700_000, 3_000_000), "color": (4_000_000, 9_000_000),
              "depth": (9_500_000, 14_000_000), "labels": (15_000_000, 20_000_000)}  # fmt: skip


@dataclass(frozen=True, eq=False)
class RenderedFrame:
    """One frame with everything known about it.

    Args:
        stamp_ns: capture stamp.
        image: (H, W, 3) uint8 RGB.
        depth: (H, W) float32 metres along z as measured, NaN unknown.
        labels: (H, W) uint8 class ids.
        T_WC: (4, 4) world from camera, optical axes.
    """

    stamp_ns: int
    image: Image
    depth: Depth
    labels: Labels
    T_WC: Pose


Message = tuple[int, int, Callable[[LogWriter], None]]
"""Log time, rank among messages of one time, and what writes it."""


def render_frames(
    *, seed: int, layout: int, width: int, height: int, rate_hz: float, length_s: float, noise: str, speed: str
) -> Generator[RenderedFrame, None, None]:
    """Frames of a walk, one in memory at a time; arguments and errors as of `render_log`.

    Values that cannot be are refused at the call, not at the first frame.
    """
    _check(width, height, rate_hz, length_s)
    check_noise(noise)
    moves = profile(speed)

    def frames() -> Generator[RenderedFrame, None, None]:
        camera, scene = office_camera(width, height), Scene(layout, seed)
        states = walk(scene.office, chance.hash31(seed, "walk", layout), length_s, moves)
        for i in range(_count(rate_hz, length_s)):
            time_s = i / rate_hz
            T_WC = pose_at(states, time_s)
            yield _captured(scene.look(camera, T_WC, time_s), camera, T_WC, i, time_s, seed, noise)

    return frames()


def render_log(
    path: Path, *, seed: int, layout: int, width: int, height: int, rate_hz: float, length_s: float, noise: str,
    speed: str, label_every: int = 1, progress: Callable[[int, int], None] | None = None,
) -> None:  # fmt: skip
    """Render a log; equal arguments give equal bytes. Whatever goes wrong, no half of a log is left behind.

    Args:
        path: the file to write.
        seed: of the walk, the noise and the transport delays.
        layout: of rooms, furniture, materials and lights.
        width, height: of the images, pixels.
        rate_hz: frames per second.
        length_s: seconds.
        noise: depth noise, `kinect` or `none`.
        speed: `steady`, `searching` or `varying`.
        label_every: truth for every so many frames.
        progress: called with (frames done, frames).

    Raises:
        UsageError: a value that cannot be; MissingExtraError: the extra `synth` is not installed; OutputError: the
        file cannot be written, told before anything is rendered.
    """
    if label_every < 1:
        raise UsageError(f"Truth for every {label_every} frames was asked for; give 1 or more.")
    rendered = render_frames(
        seed=seed, layout=layout, width=width, height=height, rate_hz=rate_hz, length_s=length_s, noise=noise,
        speed=speed,
    )  # fmt: skip
    total, camera = _count(rate_hz, length_s), office_camera(width, height)
    pending: list[Message] = []
    with closing(rendered) as frames, LogWriter(path, OFFICE) as log:
        for i, frame in enumerate(frames):
            pending += _messages(frame, camera, seed, i, label=i % label_every == 0)
            pending.sort(key=lambda message: message[:2])
            while pending and pending[0][0] <= frame.stamp_ns:
                pending.pop(0)[2](log)
            if progress is not None:
                progress(i + 1, total)
        for _, _, write in pending:
            write(log)


def office_camera(width: int, height: int) -> Camera:
    """The camera of every rendered log: 82 degrees wide, square pixels, principal point in the middle."""
    focal = FOCAL_PER_WIDTH * width
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def _captured(
    view: View, camera: Camera, T_WC: Pose, index: int, time_s: float, seed: int, noise: str
) -> RenderedFrame:
    """What the camera makes of a view."""
    rng = chance.generator(seed, "sensor", index)
    image = expose(view.radiance, 1.0, rng)
    depth = kinect(view.depth, camera.fx, rng) if noise == "kinect" else view.depth
    return RenderedFrame(START_NS + round(time_s * 10**9), image, depth, view.labels, T_WC)


def _messages(frame: RenderedFrame, camera: Camera, seed: int, index: int, *, label: bool) -> list[Message]:
    """The messages of one frame, each after a delay of its own."""
    stamp = frame.stamp_ns

    def arrival(kind: str) -> int:
        low, high = _DELAYS_NS[kind]
        return stamp + low + chance.choose(seed, high - low, "delay", kind, index)

    at = {kind: arrival(kind) for kind in _DELAYS_NS}
    depth = millimetres(frame.depth)
    messages: list[Message] = [
        (at["calibration"], 0, lambda log: log.calibration(stamp, at["calibration"], camera)),
        (at["pose"], 1, lambda log: log.pose(stamp, at["pose"], frame.T_WC)),
        (at["color"], 2, lambda log: log.color(stamp, at["color"], frame.image)),
        (at["depth"], 3, lambda log: log.depth(stamp, at["depth"], depth)),
    ]
    if label:
        messages.append((at["labels"], 4, lambda log: log.labels(stamp, at["labels"], frame.labels)))
    return messages


def _count(rate_hz: float, length_s: float) -> int:
    """Frames in so many seconds, at least one; the margin is for products such as 4.35 s * 100 Hz = 434.99."""
    return max(1, int(length_s * rate_hz + 1e-6))


def _check(width: int, height: int, rate_hz: float, length_s: float) -> None:
    if not (32 <= width <= 4096 and 32 <= height <= 4096):
        raise UsageError(f"Images of {width}x{height} were asked for; each side must be from 32 to 4096 pixels.")
    if not 0.1 <= rate_hz <= 240:
        raise UsageError(f"{rate_hz:g} frames per second were asked for; give 0.1 to 240.")
    if not 0 < length_s <= 86_400:
        raise UsageError(f"A length of {length_s:g} s was asked for; give more than 0 and at most a day.")
