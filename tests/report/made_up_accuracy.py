"""Scores of the made-up run, and what is made of them: losses, distances, calibration."""

import numpy as np
from made_up_pictures import CLASSES
from made_up_schedule import FRAMES

from stsem.chance import generator
from stsem.document.accuracy import DistanceRow, Loss, LossParts, Score
from stsem.document.calibration import Calibration, ErrorDetection, Judged, ReliabilityBin

SHARES = (0, 1, 12, 6, 19, 9, 4, 2, 0, 7, 3, 31, 6)


def score(base: float, key: str, n: int = FRAMES, misses: int = 0) -> Score:
    """A plausible score around `base`."""
    total = 480 * 270 * n
    pixels = {name: total * share // 100 for name, share in zip(CLASSES, SHARES, strict=True)}
    iou = {
        name: float(np.clip(base + 0.1 * _normal(name) + 0.01 * _normal(key, name), 0.05, 0.98))
        if pixels[name]
        else None
        for name in CLASSES
    }
    present = [value for value in iou.values() if value is not None]
    return Score(
        miou=float(np.mean(present)),
        miou_union=float(np.mean(present)) * 11 / 12,
        classes_averaged=len(present),
        iou=iou,
        pixel_accuracy=min(1.0, base + 0.09),
        pixels=total,
        misses=misses,
        n=n,
        class_pixels=pixels,
        unlabelled_share=0.031,
        miou_common=float(np.mean(present)),
        classes_common=len(present),
    )


def _normal(*key: str) -> float:
    return float(generator(4, *key).standard_normal())


def scores(mode: str) -> dict[str, Score]:
    drop = {"per-frame": (0.82, 0.66, 0.58), "keyframe": (0.76, 0.74, 0.69)}[mode]
    names = ("offline", "delivered", "streaming")
    return {
        name: score(base, mode + name, misses=2 * (name == "streaming")) for name, base in zip(names, drop, strict=True)
    }


def loss(mode: str, passes: dict[str, Score]) -> Loss:
    first = scores("per-frame")["offline"].miou or 0.0
    offline, delivered, streaming = (passes[name].miou or 0.0 for name in ("offline", "delivered", "streaming"))
    parts = {
        "network": 1 - first,
        "prediction": first - offline,
        "scheduling": offline - delivered,
        "staleness": delivered - streaming,
    }
    return Loss(**parts, n=LossParts(network=FRAMES, prediction=FRAMES, scheduling=FRAMES, staleness=FRAMES))


def by_distance() -> tuple[DistanceRow, ...]:
    n = (26, 25, 24, 24, 22, 14, 10, 4, 1)
    return tuple(
        DistanceRow(
            frames=d, ms=100.0 * d, miou=0.80 - 0.019 * d + 0.004 * (d % 2), pixel_accuracy=0.92 - 0.011 * d, n=count
        )
        for d, count in enumerate(n)
    )


def calibration(mode: str) -> dict[str, Calibration]:
    parts: dict[str, Judged] = {"segmented": "offline"}
    if mode == "keyframe":
        parts |= {"propagated": "offline", "delivered": "delivered"}
    return {name: _reliability(judged, 0.04 * (name == "propagated")) for name, judged in parts.items()}


def _reliability(judged: Judged, worse: float) -> Calibration:
    pixels = [0, 0, 90, 400, 900, 2_000, 4_000, 8_000, 12_000, 20_000, 30_000, 50_000, 80_000, 120_000, 900_000]
    middles = [(i + 0.5) / 15 for i in range(15)]
    bins = tuple(
        ReliabilityBin(lower=i / 15, upper=(i + 1) / 15, pixels=n, confidence=middle if n else None,
                       accuracy=min(1.0, middle + 0.06 - worse) if n else None)
        for i, (n, middle) in enumerate(zip(pixels, middles, strict=True))
    )  # fmt: skip
    return Calibration(judged=judged, ece=0.06 - worse, mce=0.06, confidence=0.9, accuracy=0.95 - worse,
                       pixels=sum(pixels), n=26, bins=bins)  # fmt: skip


def detection() -> ErrorDetection:
    auc = {"one_minus_confidence": 0.91, "variance": 0.85, "entropy": 0.88, "mutual_information": 0.86}
    return ErrorDetection(judged="offline", auc=auc, wrong_share=0.05, pixels=1_227_390, n=26)
