"""Calibration: sensors that were binned, cropped, scaled or rectified, and lenses that bend."""

from dataclasses import replace
from typing import Any

from analytic_scene import CAMERA, Scene
from family_rows import FOX
from tape import COLOR, INFO, Message, Part, Tape, calibration, color, depth, nothing, rgb8
from variant import Equal, Variant

from stsem.camera import Camera

RECT = "/cam/color/image_rect"
P = (CAMERA.fx, 0.0, CAMERA.cx, 0.0, 0.0, CAMERA.fy, CAMERA.cy, 0.0, 0.0, 0.0, 1.0, 0.0)
SENSOR = CAMERA.scaled(2 * CAMERA.width, 2 * CAMERA.height)
"""Each pixel of the image is 2x2 of these."""
BARREL = (-0.36, 0.11, 0.002, -0.001, 0.0)
LENSES = {
    "plumb_bob": BARREL,
    "rational_polynomial": (0.2, 0.02, 0.001, -0.0005, 0.01, 0.62, 0.1, 0.0),
    "equidistant": (-0.06, 0.01, -0.004, 0.0005),
}
"""Distortion models -> coefficients; each sees a little more than a pinhole does."""


def k(camera: Camera) -> list[float]:
    """K row by row."""
    return camera.K.ravel().tolist()


def once(late_ns: int) -> Part:
    """One calibration for the whole log, so long after the first image."""

    def part(make: Any, scene: Scene) -> Tape:
        (first, *_) = calibration()(make, scene).messages
        return Tape((Message(INFO, first.content, scene.start_ns + late_ns),))

    return part


UNCALIBRATED = Equal(camera=False, map=False, timing="other")
LENS = Equal(
    color_db=28.0, depth_m=0.06, depth_share=0.95, labels_share=0.97, map=False, scores=0.015,
    warns=(f"The lens distortion that {INFO} states",),
)  # fmt: skip
CAMERA_ROWS = (
    Variant("calibration-once", "one message, before the first image", calibration=once(-500_000_000)),
    Variant("calibration-last", "one message, behind the last image", calibration=once(5_000_000_000)),
    Variant("calibration-no-coefficients", "D is empty, the model has no name",
            calibration=calibration(d=(), model="")),
    Variant("calibration-zeros", "rational model with eight zeros",
            calibration=calibration(d=(0.0,) * 8, model="rational_polynomial")),
    Variant("calibration-no-size", "width and height are 0", calibration=calibration(width=0, height=0)),
    Variant("calibration-binning", "binned by 2x2: K is that of the sensor", calibration=calibration(
        width=SENSOR.width, height=SENSOR.height, k=k(SENSOR), binning=(2, 2))),
    Variant("calibration-roi", "a region of the sensor: K is that of all of it", calibration=calibration(
        width=100, height=80, k=k(replace(CAMERA, cx=CAMERA.cx + 11, cy=CAMERA.cy + 7)), roi=(11, 7, 64, 48))),
    Variant("calibration-binned-roi", "both", calibration=calibration(
        width=200, height=160, k=k(replace(SENSOR, cx=SENSOR.cx + 22, cy=SENSOR.cy + 14)), binning=(2, 2),
        roi=(22, 14, 128, 96))),
    Variant("calibration-scaled", "stated for twice the size: scaled, and said", calibration=calibration(
        width=SENSOR.width, height=SENSOR.height, k=k(SENSOR)), equal=Equal(warns=(f"{INFO} is for 128x96",))),
    Variant("calibration-scaled-protobuf", "the same in protobuf", make=FOX, calibration=calibration(
        width=SENSOR.width, height=SENSOR.height, k=k(SENSOR)), equal=Equal(warns=(f"{INFO} is for 128x96",))),
    Variant("calibration-rectified", "`image_rect`: P counts, D is not undone", color=color(rgb8, RECT),
            calibration=calibration(k=k(replace(CAMERA, fx=50.0, fy=51.0)), d=BARREL, p=P),
            equal=Equal(warns=(f"{RECT} is rectified, by its name",))),
    Variant("calibration-zero", "K is zero: no intrinsics, no map, and said", calibration=calibration(k=(0.0,) * 9),
            equal=replace(UNCALIBRATED, warns=(f"{INFO} says that the camera is uncalibrated",))),
    Variant("calibration-none", "no calibration: no map", calibration=nothing, equal=UNCALIBRATED),
    Variant("calibration-of-depth", "only one of the registered depth camera: it serves, and said",
            calibration=calibration("/cam/depth/camera_info", frame_id="depth_optical"),
            depth=depth(lambda make, t, v: make.image(t, v.mm.astype("<u2"), "16UC1", frame_id="depth_optical")),
            opened={"depth_registered": "yes"},
            equal=Equal(warns=(f"{COLOR} has no calibration; that of",))),
    *(
        Variant(f"lens-{model}", f"a lens after `{model}`: undone once", equal=LENS,
                scene=Scene(camera=replace(CAMERA, model=model, distortion=d)))
        for model, d in LENSES.items()
    ),
    Variant("lens-protobuf", "the same in protobuf", make=FOX, equal=LENS,
            scene=Scene(camera=replace(CAMERA, model="plumb_bob", distortion=BARREL))),
    Variant("lens-fisheye", "`fisheye` is another name of `equidistant`", equal=LENS,
            scene=Scene(camera=replace(CAMERA, model="equidistant", distortion=LENSES["equidistant"])),
            calibration=calibration(model="fisheye")),
)  # fmt: skip
