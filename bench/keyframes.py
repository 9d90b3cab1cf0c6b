"""mIoU against the share of frames segmented: every keyframe policy with every propagation, at equal budget.

    python -m bench.keyframes RESULTS.jsonl LOG ... [--model oracle] [--methods depth,flow,...] [--policies every:8,...]

Replays the logs without a clock, one cell (log, model, policy, method) after another, and appends each to RESULTS as it
is done; what is there already is not done again. Network outputs come from the cache. With `--partial SHARE`, frames
covered less than SHARE are also labelled by the network where they are not covered (see `Partial`).
`bench.keyframe_tables` prints what came of it.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from stsem.classes import NO_LABEL, Labels
from stsem.frame import Frame, Image, Segmentation
from stsem.geometry.features import Features, extract
from stsem.geometry.flow import Field, Grey, Search, backward_flow
from stsem.inference.threads import set_threads
from stsem.log.log import Loaded, open_log
from stsem.metrics.confusion import confusion
from stsem.metrics.scores import scores
from stsem.replay.answer import AnswerRule, Prediction
from stsem.replay.build import Model, build_model, policy_of, registering, settled
from stsem.replay.config import RunConfig
from stsem.replay.hosttimes import StageTimes
from stsem.stages import register
from stsem.stages.budget import BURST, BudgetPolicy
from stsem.stages.keyframe import Keyframe, view_of
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.propagation import flow
from stsem.stages.propagation.method import Propagation

EVERY = tuple(f"every:{n}" for n in (2, 3, 4, 6, 8, 12, 16))
PAPER = tuple(f"paper*{scale:g}" for scale in (0.5, 1, 2, 3))
COVERAGE = tuple(f"coverage:{share:g}" for share in (0.95, 0.9, 0.8, 0.7, 0.5))
BUDGET = tuple(f"budget:{hz:g}" for hz in (3.3333, 2.5, 1.6667, 1.25, 0.8333))
GRID = (*EVERY, *PAPER, *COVERAGE, *BUDGET)
TIME_S = 3.0
"""Longest time between keyframes of `paper` and `coverage`, so that it decides little."""
STRIDE = 32
"""Pixels to which a crop is snapped."""


@dataclass(frozen=True)
class Cell:
    """What one replay gave; `cost` is in networks a frame, crops of `partial` at their share of the image."""

    log: str
    model: str
    method: str
    policy: str
    partial: float
    frames: int
    keyframes: int
    miou: float
    pixel_accuracy: float
    covered: float
    crops: int
    cost: float

    @property
    def key(self) -> tuple[str, str, str, str, float]:
        return self.log, self.model, self.method, self.policy, self.partial


def configured(policy: str, method: str, model: str) -> RunConfig:
    """`paper*S`: the paper's rule with its default thresholds times S."""
    name, _, scale = policy.partition("*")
    name = "paper" if trial(policy) else name
    plain, factor = RunConfig(), float(scale or 1)
    return RunConfig(
        mode="keyframe", model=model, keyframes=name, propagation=method, keyframe_time_s=TIME_S, clock="offline",
        keyframe_rotation=factor * plain.keyframe_rotation, keyframe_translation=factor * plain.keyframe_translation,
    )  # fmt: skip


def trial(policy: str) -> BudgetPolicy | None:
    """A budget by motion or coverage whatever the method: `moved:HZ`, `covered:HZ`; with the burst B `moved/B:HZ`."""
    name, _, hz = policy.partition(":")
    by, _, burst = name.partition("/")
    if by not in ("moved", "covered"):
        return None
    return BudgetPolicy(float(hz), by_coverage=by == "covered", burst=int(burst or BURST))


class Partial:
    """Re-segmentation of what is not covered, at its best: the network's labels as if it had seen the whole image.

    A real crop sees less around it, so this bounds what one could gain. What it finds is remembered by the method.

    Args:
        share: frames covered less than this get a crop; 0 for none.
        method: remembers.
        segment: the network on a whole frame.
    """

    def __init__(self, share: float, method: Propagation, segment: Callable[[Frame], Segmentation]) -> None:
        self._share, self._method, self._segment = share, method, segment
        self.crops, self.area = 0, 0.0

    def __call__(self, frame: Frame, answer: Segmentation) -> Labels:
        covered = answer.covered
        if covered is None or covered.mean() >= self._share:
            return answer.labels
        there = self._segment(frame).labels
        self.crops += 1
        self.area += _box(~covered)
        only = Segmentation(np.where(covered, np.uint8(NO_LABEL), there))
        self._method.finished(Keyframe(frame.index, frame.stamp_ns, only, None, view_of(frame), frame.image))
        return np.where(covered, answer.labels, there)


def _box(mask: np.ndarray) -> float:
    """Share of the image in the smallest box, snapped to STRIDE, around all but the 5 % outermost pixels of `mask`."""
    area = 1.0
    for axis, size in ((0, mask.shape[1]), (1, mask.shape[0])):
        weight = mask.sum(axis=axis).cumsum() / mask.sum()
        low, high = np.searchsorted(weight, 0.025), np.searchsorted(weight, 0.975) + 1
        area *= min(size, -(-(high - low) // STRIDE) * STRIDE) / size
    return area


def replayed(frames: list[Loaded], model: Model, cell: tuple[str, str, float]) -> dict[str, Any]:
    """Scores and counts of one cell (method, policy, partial)."""
    method_name, policy_name, share = cell
    classes = len(model.classes)
    config = configured(policy_name, method_name, "oracle" if model.network is None else "default")
    policy, method = trial(policy_name) or policy_of(config), PROPAGATIONS[method_name].make(model.classes, 0)
    segmenter = model.segmenter(1, StageTimes())
    rule = AnswerRule(segmenter, Prediction(policy, method, registering(policy, method, 0)))
    partial = Partial(share, method, segmenter.segment)
    matrix, shares, keyframes = np.zeros((classes, classes + 1), np.int64), [], 0
    for loaded in frames:
        frame = loaded.frame
        assert frame is not None
        registration = rule.register(frame) if rule.registers else None
        if rule.choose(frame, registration) is not None:
            answer = segmenter.segment(frame)
            rule.finish(frame, answer)
            labels, keyframes = answer.labels, keyframes + 1
        else:
            found = rule.propagate(frame, registration)
            assert found is not None
            shares.append(1.0 if found.answer.covered is None else float(found.answer.covered.mean()))
            labels = partial(frame, found.answer)
        if loaded.truth is not None:
            matrix += confusion(loaded.truth, labels, classes)
    whole = scores(matrix)
    return {
        "frames": len(frames), "keyframes": keyframes, "miou": whole.miou, "pixel_accuracy": whole.pixel_accuracy,
        "covered": float(np.mean(shares)) if shares else 1.0, "crops": partial.crops,
        "cost": (keyframes + partial.area) / len(frames),
    }  # fmt: skip


def remember_what_no_keyframe_changes() -> None:
    """Points and flow between neighbours are the same in every cell: each is computed once for each log."""
    points: dict[bytes, Features] = {}
    flows: dict[tuple[bytes, bytes], Field] = {}

    def features(image: Image) -> Features:
        key = image.tobytes()[::97]
        return points.get(key) or points.setdefault(key, extract(image))

    def remembered(current: Grey, previous: Grey, *, search: Search) -> Field:
        key = current.tobytes()[::31], previous.tobytes()[::31]
        if key not in flows:
            flows[key] = backward_flow(current, previous, search=search)
        return flows[key]

    register.extract, flow.backward_flow = features, remembered  # type: ignore[assignment]


def read(path: Path) -> dict[tuple[str, str, str, str, float], Cell]:
    lines = path.read_text().splitlines() if path.exists() else []
    cells = [Cell(**json.loads(line)) for line in lines]
    return {cell.key: cell for cell in cells}


def measure(path: Path, given: argparse.Namespace) -> None:
    """Append the cells that are missing."""
    for name in given.logs:
        remember_what_no_keyframe_changes()
        with open_log([name]) as log:
            model = build_model(log, settled(log, RunConfig(model=given.model)))
            previous = model.network is not None and model.network.has_difference
            frames = list(log.frames(range(len(log.plans)), depth=True, previous=previous, truth=True))
            for method in given.methods.split(","):
                for policy in ("every:1", *given.policies.split(",")):
                    asked = policy.startswith("coverage") and not PROPAGATIONS[method].covers
                    key = name.stem, given.model, method, policy, given.partial
                    if asked or key in read(path):
                        continue
                    found = replayed(frames, model, (method, policy, given.partial))
                    with path.open("a") as file:
                        file.write(json.dumps(asdict(Cell(*key, **found))) + "\n")
                    print(*key, f"{found['keyframes']} keyframes {100 * found['miou']:.1f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("logs", type=Path, nargs="*")
    parser.add_argument("--model", default="oracle")
    parser.add_argument("--methods", default="depth,flow,homography,hold")
    parser.add_argument("--policies", default=",".join(GRID))
    parser.add_argument("--partial", type=float, default=0.0)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    set_threads(1)
    measure(given.results, given)


if __name__ == "__main__":
    main()
