"""Colour: every raw encoding, every file format, and what format strings say."""

from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from typing import Any

import cv2
import numpy as np
from analytic_scene import CAMERA, Scene, View
from encoders_ros import Encoded
from family_rows import FOX
from image_messages import encoded
from PIL import Image as PilImage
from raw_layouts import CHANNELS, YUV
from tape import COLOR, Draw, color
from variant import Equal, Variant, rows

from stsem.log.pixels.encodings import ENCODINGS

Array = np.ndarray[Any, Any]
GREY = Equal(grey=True)
MOSAICS = tuple(name for name in ENCODINGS if name.startswith("bayer"))
ODD = Scene(camera=replace(CAMERA, width=63, height=47))


def raw(encoding: str, *, padding: int = 0, big_endian: bool = False, spelled: str | None = None) -> Draw:
    """The scene in a raw encoding."""
    store = _mosaic if encoding in MOSAICS else _yuv if encoding in YUV else _channels

    def draw(make: Any, stamp_ns: int, view: View) -> Encoded:
        stored = store(encoding, view.rgb)
        if big_endian:
            stored = stored.astype(stored.dtype.newbyteorder(">"))
        size = view.rgb.shape[1::-1]
        return make.image(stamp_ns, stored, spelled or encoding, padding=padding, **_sized(stored, size))

    return draw


def _sized(stored: Array, size: tuple[int, int]) -> dict[str, Any]:
    return {} if stored.shape[1::-1] == size else {"size": size}


def _wide(encoding: str, pixels: Array) -> Array:
    """Bytes filled up to 16 bits where the encoding has them."""
    return (pixels.astype("<u2") * 257) if encoding.endswith("16") or encoding.startswith("16") else pixels


def _channels(encoding: str, rgb: Array) -> Array:
    letters = CHANNELS[encoding]
    if len(letters) == 1:
        return _wide(encoding, rgb[:, :, 1])
    rgba = np.dstack([rgb, np.full(rgb.shape[:2], 200, np.uint8)])
    return _wide(encoding, rgba[:, :, ["RGBA".index(letter) for letter in letters]])


def _mosaic(encoding: str, rgb: Array) -> Array:
    height, width = rgb.shape[:2]
    block = np.array(["rgb".index(letter) for letter in encoding.removeprefix("bayer_")[:4]]).reshape(2, 2)
    seen = np.tile(block, (height, width))[:height, :width]
    return _wide(encoding, np.take_along_axis(rgb, seen[:, :, None], 2)[:, :, 0])


def _yuv(encoding: str, rgb: Array) -> Array:
    """BT.601 in studio range; shared colour is the mean of its pixels; an odd width is filled up."""
    across, down, store = YUV[encoding]
    if rgb.shape[1] % across:
        rgb = np.concatenate([rgb, rgb[:, -1:]], axis=1)
    r, g, b = np.moveaxis(rgb.astype(np.float64), -1, 0)
    y = 0.299 * r + 0.587 * g + 0.114 * b
    planes = 16 + 219 / 255 * y, 128 + 224 / 255 * (b - y) / 1.772, 128 + 224 / 255 * (r - y) / 1.402
    height, width = y.shape
    shared = (p.reshape(height // down, down, width // across, across).mean(axis=(1, 3)) for p in planes[1:])
    return store(*(np.rint(plane).astype(np.uint8) for plane in (planes[0], *shared)))


def file(encode: Callable[[Array], bytes], form: str, topic: str = f"{COLOR}/compressed") -> dict[str, Any]:
    """The scene as image files."""
    return {"color": color(lambda make, t, view: make.compressed(t, encode(view.rgb), form), topic)}


def jpeg(rgb: Array, *options: int) -> bytes:
    """A good jpeg."""
    return encoded(".jpg", rgb, cv2.IMWRITE_JPEG_QUALITY, 95, *options)


def _png16(rgb: Array) -> bytes:
    return encoded(".png", rgb.astype(np.uint16) * 257)


def _png_with_alpha(rgb: Array) -> bytes:
    alpha = np.full(rgb.shape[:2], 9, np.uint8)
    return bytes(cv2.imencode(".png", np.dstack([rgb[:, :, ::-1], alpha]))[1])


def _by_pillow(rgb: Array, form: str, *, palette: bool = False, **options: Any) -> bytes:
    image = PilImage.fromarray(rgb)
    stream = BytesIO()
    (image.quantize(256, dither=PilImage.Dither.NONE) if palette else image).save(stream, form, **options)
    return stream.getvalue()


def _turned_by_tag(rgb: Array) -> bytes:
    exif = PilImage.Exif()
    exif[0x0112] = 6
    return _by_pillow(rgb, "JPEG", quality=95, exif=exif)


FORMATS = {
    "jpeg": "jpeg", "jpg": "jpg", "capitals": "JPEG", "media-type": "image/jpeg", "suffix": ".jpg",
    "transport": "rgb8; jpeg compressed bgr8", "transport-short": "bgr8; jpeg compressed", "nothing": "",
    "wrong": "png", "bare-encoding": "bgr8",
}  # fmt: skip
"""Rows -> what the format field says of the same jpeg."""
EXACT = tuple(name for name, letters in CHANNELS.items() if len(letters) > 1)
LEAST_DB = {"nv24": 48.0, "nv12": 32.0, "nv21": 32.0, "i420": 32.0}
JPEG = Equal(color_db=33.5)

RAW = (
    *(Variant(f"color-{name}", f"`{name}`, raw", color=color(raw(name))) for name in EXACT),
    *rows(
        (
            Variant("color-mono8", "`mono8`: the grey value three times", color=color(raw("mono8"))),
            Variant("color-8UC1", "`8UC1`: the same", color=color(raw("8UC1"))),
            Variant(
                "color-mono16", "`mono16` is depth unless asked for: `--topic color=`", color=color(raw("mono16")),
                opened={"topics": {"color": COLOR}},
            ),
        ),
        equal=GREY,
    ),
    *(
        Variant(f"color-{name}", f"`{name}`, raw", color=color(raw(name)), equal=Equal(color_db=27.0))
        for name in MOSAICS
    ),
    *(
        Variant(f"color-{name}", f"`{name}`, raw", color=color(raw(name)), equal=Equal(color_db=LEAST_DB.get(name, 34)))
        for name in YUV
    ),
    Variant("color-16-bit-big-endian", "`rgb16` with `is_bigendian`", color=color(raw("rgb16", big_endian=True))),
    Variant("color-padding", "rows of `bgr8` filled up by 7 bytes", color=color(raw("bgr8", padding=7))),
    Variant("color-padding-nv12", "all rows of `nv12` filled up by 6 bytes", color=color(raw("nv12", padding=6)),
            equal=Equal(color_db=32.0)),
    Variant("color-padding-protobuf", "padding in protobuf", make=FOX, color=color(raw("rgb8", padding=5))),
    Variant("color-encoding-in-capitals", "`RGB8` with blanks around", color=color(raw("rgb8", spelled=" RGB8 "))),
    *rows(
        (
            Variant("color-odd-size-bgr8", "63x47 pixels, padded", color=color(raw("bgr8", padding=3))),
            Variant("color-odd-size-yuyv", "63x47 pixels in pairs", color=color(raw("yuyv")),
                    equal=Equal(color_db=34.0)),
            Variant("color-odd-size-bayer", "63x47 pixels in a mosaic", color=color(raw("bayer_grbg8")),
                    equal=Equal(color_db=27.0)),
        ),
        scene=ODD,
    ),
)  # fmt: skip
FILES = (
    *(
        Variant(f"format-{name}", f"jpeg whose format field says `{form}`" if form else "jpeg without a format",
                **file(jpeg, form), equal=JPEG)
        for name, form in FORMATS.items()
    ),
    Variant("jpeg-progressive", "progressive jpeg", equal=JPEG,
            **file(lambda rgb: jpeg(rgb, cv2.IMWRITE_JPEG_PROGRESSIVE, 1), "jpeg")),
    Variant("jpeg-subsampled", "jpeg in 4:2:0", equal=JPEG, **file(
        lambda rgb: jpeg(rgb, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420), "jpeg")),
    Variant("jpeg-grey", "jpeg of one channel", equal=Equal(grey=True, color_db=44.0),
            **file(lambda rgb: jpeg(rgb[:, :, 1]), "jpeg")),
    Variant("jpeg-turned-by-tag", "jpeg with an orientation tag, which is ignored as by ROS",
            equal=JPEG,
            **file(_turned_by_tag, "jpeg")),
    Variant("png", "png of 8 bits", **file(lambda rgb: encoded(".png", rgb), "rgb8; png compressed bgr8")),
    Variant("png-16-bit", "png of 16 bits a channel", **file(_png16, "png")),
    Variant("png-alpha", "png with alpha, which is dropped", **file(_png_with_alpha, "png")),
    Variant("png-grey", "png of one channel", **file(lambda rgb: encoded(".png", rgb[:, :, 1]), "png"), equal=GREY),
    Variant("png-palette", "png with a palette of 256 colours", equal=Equal(color_db=36.0),
            **file(lambda rgb: _by_pillow(rgb, "PNG", palette=True), "png")),
    Variant("webp", "webp with loss", **file(lambda rgb: encoded(".webp", rgb, cv2.IMWRITE_WEBP_QUALITY, 95), "webp"),
            equal=Equal(color_db=33.0)),
    Variant("webp-lossless", "webp without loss",
            **file(lambda rgb: encoded(".webp", rgb, cv2.IMWRITE_WEBP_QUALITY, 101), "webp")),
    Variant("jpeg-protobuf", "jpeg in protobuf", make=FOX, equal=JPEG, **file(jpeg, "jpeg")),
)  # fmt: skip
COLOR_ROWS = (*RAW, *FILES)
