"""What the time of a prediction goes into: the functions of `stsem.geometry` that methods call, timed from outside."""

import functools
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from stsem.geometry import carry, flow, likeness, reproject
from stsem.stages.propagation import depth as depth_method
from stsem.stages.propagation import flow as flow_method

TIMED: tuple[tuple[Any, str, str], ...] = (
    (flow_method, "working_grey", "grey"),
    (flow_method, "backward_flow", "flow"),
    (flow.Chain, "extended", "chain"),
    (flow.Chain, "carry", "labels by flow"),
    (flow.Chain, "trace", "labels by flow of some pixels"),
    (reproject, "filled", "depth in shadows"),
    (depth_method, "carry", "labels by depth"),
    (carry, "correspond", "- newest keyframe"),
    (reproject, "_search_beside", "  - search beside the pixel"),
    (carry, "among", "- earlier keyframes, shadows"),
    (depth_method, "carry_more", "labels in shadows"),
    (depth_method, "described", "description"),
    (depth_method, "guess", "likeness"),
    (likeness.Likeness, "votes", "- nearest examples"),
    (likeness, "diffused", "- neighbours"),
    (likeness, "spread", "- pixels"),
)
"""(where it is looked up, its name, how it is printed); a dash marks a part of the part above."""


class Parts:
    """Seconds of one thread by part, frame by frame and method by method.

    Args:
        wanted: else nothing is timed and nothing printed.
    """

    def __init__(self, *, wanted: bool) -> None:
        self._now: dict[str, float] = defaultdict(float)
        self._frames: dict[str, list[dict[str, float]]] = defaultdict(list)
        for owner, name, part in TIMED if wanted else ():
            setattr(owner, name, self._timed(getattr(owner, name), part))

    @contextmanager
    def of(self, method: str) -> Iterator[None]:
        """One frame of `method`."""
        self._now.clear()
        yield
        self._frames[method].append(dict(self._now))

    def lines(self, method: str) -> list[str]:
        """Median and mean milliseconds a frame of every part that was called."""
        frames = self._frames[method]
        rows = {part: [1e3 * frame.get(part, 0) for frame in frames] for _, _, part in TIMED}
        return [f"  {part:32s} {np.median(ms):6.2f} (mean {np.mean(ms):.2f})" for part, ms in rows.items() if any(ms)]

    def _timed(self, function: Callable[..., Any], part: str) -> Callable[..., Any]:
        @functools.wraps(function)
        def timed(*args: Any, **kwargs: Any) -> Any:
            start = time.thread_time()
            try:
                return function(*args, **kwargs)
            finally:
                self._now[part] += time.thread_time() - start

        return timed
