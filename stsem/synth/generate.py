"""Rendered logs: an office, a walk through it, a camera's faults, and the file."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stsem import chance
from stsem.camera import Camera
from stsem.classes import Labels
from stsem.errors import UsageError
from stsem.frame import Depth, Image
from stsem.log.writer import LogWriter
from stsem.pose import Pose
from stsem.synth.lighting import illuminate
from stsem.synth.office import Office, build_office
from stsem.synth.path import pose_at, profile, walk
from stsem.synth.sensor import check_noise, expose, kinect, millimetres
from stsem.synth.tracer import Tracer
from stsem.synth.view import LitBody, lit_body, look
from stsem.synth.vocabulary import OFFICE
from stsem.synth.walkers import Walker, walker

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


def render_frames(
    *, seed: int, layout: int, width: int, height: int, rate_hz: float, length_s: float, noise: str, speed: str
) -> Iterator[RenderedFrame]:
    """Frames of a walk; arguments as of `render_log`."""
    check_noise(noise)
    office, camera = build_office(layout), office_camera(width, height)
    states = walk(office, chance.hash31(seed, "walk", layout), length_s, profile(speed))
    tracer = Tracer(office.quads)
    static = lit_body(
        office.quads, tracer, illuminate(office.quads, tracer, office.furnishing.lights), office.materials
    )
    people = walker(office, seed)
    for i in range(max(1, int(length_s * rate_hz))):
        time_s = i / rate_hz
        yield _frame(office, camera, static, people, pose_at(states, time_s), i, time_s, seed, noise)


def render_log(
    path: Path, *, seed: int, layout: int, width: int, height: int, rate_hz: float, length_s: float, noise: str,
    speed: str, label_every: int = 1, progress: Callable[[int, int], None] | None = None,
) -> None:  # fmt: skip
    """Render a log; equal arguments give equal bytes.

    Args:
        path: the file to write.
        seed: of the walk, the noise and the transport delays.
        layout: of rooms, furniture, materials and lights.
        width, height: of the images, pixels.
        rate_hz: frames per second.
        length_s: seconds.
        noise: depth noise, `kinect` or `none`.
        speed: `steady` or `varying`.
        label_every: truth for every so many frames.
        progress: called with (frames done, frames).

    Raises:
        UsageError: a value that cannot be; MissingExtraError: the extra `synth` is not installed; OutputError.
    """
    _check(width, height, rate_hz, length_s, label_every)
    total, camera = max(1, int(length_s * rate_hz)), office_camera(width, height)
    frames = render_frames(
        seed=seed, layout=layout, width=width, height=height, rate_hz=rate_hz, length_s=length_s, noise=noise,
        speed=speed,
    )  # fmt: skip
    pending: list[tuple[int, int, str, int, object]] = []
    with LogWriter(path, OFFICE) as log:
        for i, frame in enumerate(frames):
            pending += _messages(frame, camera, seed, i, label=i % label_every == 0)
            pending.sort(key=lambda entry: entry[:2])
            while pending and pending[0][0] <= frame.stamp_ns:
                _write(log, pending.pop(0))
            if progress is not None:
                progress(i + 1, total)
        for entry in pending:
            _write(log, entry)


def office_camera(width: int, height: int) -> Camera:
    """The camera of every rendered log: 82 degrees wide, square pixels, principal point in the middle."""
    focal = FOCAL_PER_WIDTH * width
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def _frame(
    office: Office, camera: Camera, static: LitBody, people: list[Walker], T_WC: Pose, index: int, time_s: float,
    seed: int, noise: str,
) -> RenderedFrame:  # fmt: skip
    bodies = [static, *(person.at(time_s) for person in people)]
    spots = np.array([person.place(time_s)[:2] for person in people], np.float64).reshape(-1, 2)
    view = look(bodies, office.materials, camera, T_WC, spots)
    rng = chance.generator(seed, "sensor", index)
    image = expose(view.radiance, 1.0, rng)
    depth = kinect(view.depth, camera.fx, rng) if noise == "kinect" else view.depth
    stamp = START_NS + round(time_s * 10**9)
    return RenderedFrame(stamp, image, depth, view.labels, T_WC)


def _messages(
    frame: RenderedFrame, camera: Camera, seed: int, index: int, *, label: bool
) -> list[tuple[int, int, str, int, object]]:
    """(log time, order, kind, stamp, payload) of one frame's messages."""
    payloads: dict[str, object] = {
        "calibration": camera, "pose": frame.T_WC, "color": frame.image, "depth": millimetres(frame.depth),
    }  # fmt: skip
    if label:
        payloads["labels"] = frame.labels
    found = []
    for order, (kind, payload) in enumerate(payloads.items()):
        low, high = _DELAYS_NS[kind]
        delay = low + chance.choose(seed, high - low, "delay", kind, index)
        found.append((frame.stamp_ns + delay, order, kind, frame.stamp_ns, payload))
    return found


def _write(log: LogWriter, entry: tuple[int, int, str, int, object]) -> None:
    log_ns, _, kind, stamp_ns, payload = entry
    write = {
        "calibration": log.calibration, "pose": log.pose, "color": log.color, "depth": log.depth, "labels": log.labels,
    }[kind]  # fmt: skip
    write(stamp_ns, log_ns, payload)  # type: ignore[operator]


def _check(width: int, height: int, rate_hz: float, length_s: float, label_every: int) -> None:
    if not (32 <= width <= 4096 and 32 <= height <= 4096):
        raise UsageError(f"Images of {width}x{height} were asked for; each side must be from 32 to 4096 pixels.")
    if not 0.1 <= rate_hz <= 240:
        raise UsageError(f"{rate_hz:g} frames per second were asked for; give 0.1 to 240.")
    if not 0 < length_s <= 86_400:
        raise UsageError(f"A length of {length_s:g} s was asked for; give more than 0 and at most a day.")
    if label_every < 1:
        raise UsageError(f"Truth for every {label_every} frames was asked for; give 1 or more.")
