"""Labels: ids of 8, 16 and 32 bits, palettes, colours; all the same to the class table."""

import io

import cv2
import numpy as np
import pytest
from image_messages import compressed, encoded, png_chunk, raw, written_png
from made_up_logs import picture
from PIL import Image

from stsem.log.classtable import Translator, parse
from stsem.log.pixels import decode
from stsem.log.schemas.messages import CompressedImage, RawImage

IDS = np.random.default_rng(4).integers(0, 4, (12, 17), np.uint8)
COLOURS = ((10, 20, 30), (40, 50, 60), (255, 0, 1), (0, 99, 0))
BY_ID = dict(enumerate(COLOURS))
TABLE = parse({name: "#{:02x}{:02x}{:02x}".format(*rgb) for name, rgb in zip("abcd", COLOURS, strict=True)}, "test")


def palette_png(ids: np.ndarray, palette: list[int], bits: int = 8, **options: object) -> bytes:
    image = Image.fromarray(ids, "L")
    image.putpalette(palette)
    buffer = io.BytesIO()
    image.save(buffer, "png", bits=bits, **options)
    return buffer.getvalue()


def colour_bytes(*order: int) -> list[int]:
    return [value for i in order for value in COLOURS[i]]


def grey_png(ids: np.ndarray, bits: int) -> bytes:
    """Several samples to a byte, the first at its top."""
    spread = np.unpackbits(ids[:, :, None].astype(np.uint8), axis=2)[:, :, 8 - bits :].reshape(len(ids), -1)
    rows = np.pad(np.packbits(spread, axis=1), ((0, 0), (1, 0)))
    return written_png(ids.shape[::-1], bits, 0, rows.tobytes())


GREY_ALPHA = np.pad(np.dstack([IDS, 7 + IDS]).reshape(len(IDS), -1), ((0, 0), (1, 0)))
RGB = np.array(COLOURS, np.uint8)[IDS]
EVERY_WAY = {
    "mono8": raw(IDS, "mono8"),
    "8UC1": raw(IDS, "8UC1", padding=3),
    "16UC1": raw(IDS.astype("<u2"), "16UC1"),
    "mono16": raw(IDS.astype(">u2"), "mono16", big_endian=True, padding=1),
    "32SC1": raw(IDS.astype("<i4"), "32SC1", padding=1),
    "32SC1 big": raw(IDS.astype(">i4"), "32SC1", big_endian=True),
    "png 8": compressed(encoded(".png", IDS)),
    "png 16": compressed(encoded(".png", IDS.astype(np.uint16)), "16UC1; png"),
    "png 4": compressed(grey_png(IDS, 4)),
    "png 2": compressed(grey_png(IDS, 2)),
    "palette": compressed(palette_png(IDS, [9, 9, 9, 8, 8, 8, 7, 7, 7, 6, 6, 6])),
    "palette of 4 bits": compressed(palette_png(IDS, [9, 9, 9, 8, 8, 8, 7, 7, 7, 6, 6, 6], bits=4)),
    "transparent palette": compressed(palette_png(IDS, [9, 9, 9] * 4, transparency=2)),
    "palette in the table's colours and order": compressed(palette_png(IDS, colour_bytes(0, 1, 2, 3))),
    "palette in the table's colours": compressed(palette_png(3 - IDS, colour_bytes(3, 2, 1, 0))),
    "rgb8": raw(RGB, "rgb8"),
    "bgr8": raw(RGB[:, :, ::-1], "bgr8"),
    "rgba8": raw(np.dstack([RGB, IDS]), "rgba8"),
    "bgra8": raw(np.dstack([RGB[:, :, ::-1], IDS]), "bgra8"),
    "png rgb": compressed(encoded(".png", RGB)),
    "png rgba": compressed(cv2.imencode(".png", np.dstack([RGB[:, :, ::-1], IDS]))[1].tobytes()),
    "png grey and alpha": compressed(written_png(IDS.shape[::-1], 8, 4, GREY_ALPHA.tobytes())),
    "compressedDepth": compressed(bytes(12) + encoded(".png", IDS.astype(np.uint16)), "16UC1; compressedDepth png"),
}  # fmt: skip


@pytest.mark.parametrize("way", EVERY_WAY)
def test_every_way_gives_the_same_labels(way: str) -> None:
    labels, unknown = Translator(TABLE)(decode.labels(EVERY_WAY[way], TABLE.colour_of))
    np.testing.assert_array_equal(labels, IDS)
    assert unknown == 0


def test_wide_ids() -> None:
    for message in (
        raw((IDS * 200).astype(">u2"), "16UC1", big_endian=True),
        raw((IDS * 200).astype("<i4"), "32SC1"),
        compressed(encoded(".png", (IDS * 200).astype(np.uint16))),
    ):
        np.testing.assert_array_equal(decode.labels(message), IDS * 200)


def test_what_16_bits_cannot_hold_is_an_unknown_id() -> None:
    ids = np.array([[0, 1, -1, 65536, 2**31 - 1, -(2**31), 65534]], "<i4")
    assert decode.labels(raw(ids, "32SC1")).tolist() == [[0, 1, 65535, 65535, 65535, 65535, 65534]]
    labels, unknown = Translator(TABLE)(decode.labels(raw(ids, "32SC1")))
    assert (labels.tolist(), unknown) == ([[0, 1, 255, 255, 255, 255, 255]], 5)
    ignoring = parse({"names": list("abcd"), "ignore_id": -1}, "test")
    assert Translator(ignoring)(decode.labels(raw(ids[:, :3], "32SC1")))[1] == 0


def test_a_palette_counts_by_the_entries_in_use() -> None:
    ids = np.array([[0, 1], [1, 0]], np.uint8)
    spare = compressed(palette_png(ids, [*colour_bytes(3, 1), 1, 2, 3]))
    assert decode.labels(spare, BY_ID).tolist() == np.array(COLOURS)[[[3, 1], [1, 3]]].tolist()
    unlabelled = compressed(palette_png(ids, [*colour_bytes(3), 1, 2, 3]))
    assert decode.labels(unlabelled, BY_ID).tolist() == [[list(COLOURS[3]), [1, 2, 3]], [[1, 2, 3], list(COLOURS[3])]]
    void = compressed(palette_png(np.where(ids, 200, 0).astype(np.uint8), [*colour_bytes(0), *[1, 2, 3] * 255]))
    assert decode.labels(void, BY_ID).tolist() == [[0, 200], [200, 0]]
    assert decode.labels(spare).tolist() == ids.tolist()


def test_a_palette_that_is_too_short() -> None:
    data = written_png((2, 1), 8, 3, b"\0\0\5", before=png_chunk(b"PLTE", bytes(COLOURS[0])))
    assert decode.labels(compressed(data), BY_ID).tolist() == [[0, 5]]


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (raw(np.zeros((2, 2), "<f4"), "32FC1"), "labels need whole numbers or colours of 8 bits, but 32FC1 came"),
        (raw(np.zeros((2, 2, 3), "<u2"), "rgb16"), "labels need whole numbers or colours of 8 bits, but rgb16 came"),
        (raw(IDS, "bayer_rggb8"), "labels need ids or colours as they are, but bayer_rggb8 came, which mixes pixels"),
        (raw(np.zeros((2, 2, 2), "u1"), "yuyv"), "but yuyv came, which mixes pixels"),
        (raw(IDS, "nv12"), "but nv12 came, which mixes pixels"),
        (compressed(encoded(".jpg", picture(0)), "jpg"), "labels need a lossless image (raw or png), but jpeg came"),
        (compressed(encoded(".webp", picture(0))), "but webp came"),
        (compressed(encoded(".png", picture(0).astype(np.uint16))), "but a coloured png of 16 bits came"),
        (compressed(bytes(12) + encoded(".png", IDS), "32FC1; compressedDepth png"), "labels need whole numbers"),
        (compressed(b"BM" + bytes(60)), "bmp is not supported"),
    ],
)
def test_what_cannot_be_labels_is_refused_with_a_reason(message: RawImage | CompressedImage, words: str) -> None:
    with pytest.raises(ValueError, match=r"\w+ \w+") as caught:
        decode.labels(message)
    assert words in str(caught.value)
