"""From an assembly to its frames: which depth and label images go with which colour image."""

import numpy as np

from stsem.log.assemble import Assembly
from stsem.log.plan import Partners, pair_depth, pair_truth
from stsem.log.plans import FramePlans, make_plans


def pair_all(assembly: Assembly) -> tuple[Partners, int]:
    """(partners of every colour frame of the log, how many label images are not of exactly its stamp)."""
    color = assembly.color.rows
    none = np.full(len(color), -1, np.int64)
    depth = pair_depth(color, assembly.depth.rows) if assembly.depth else none
    if assembly.labels is None or assembly.table is None:
        return Partners(depth, none), 0
    truth, inexact = pair_truth(color, assembly.labels.rows)
    return Partners(depth, truth), inexact


def plan_all(assembly: Assembly, partners: Partners, rows: slice) -> FramePlans:
    """Plans of the colour frames `rows`, with the clock offsets taken out of their log times."""
    channels, offset = (assembly.color, assembly.depth, assembly.labels), assembly.clock_offsets_ns
    topics = [c.topic if c else None for c in channels] + [assembly.pose_topic]
    color, depth, truth, pose = (offset.get(topic, 0) if topic else 0 for topic in topics)
    return make_plans(
        assembly.color.rows, assembly.depth.rows if assembly.depth else None,
        assembly.labels.rows if assembly.labels else None, partners, assembly.poses, rows,
        (color, depth, pose, truth),
    )  # fmt: skip
