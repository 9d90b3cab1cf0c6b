"""A log replayed with the truth as the network: every number of both modes, and the map."""

from dataclasses import dataclass
from typing import Any

from stsem.log.log import Log
from stsem.mapping.cloud import LabelledPoints
from stsem.replay.build import build_model
from stsem.replay.config import RunConfig
from stsem.replay.costing import Costing
from stsem.replay.engine import replay_log
from stsem.replay.runs import Context, part, scored
from stsem.sim.costs import ConstantCosts

EVERY = 4
CONFIG = RunConfig(mode="per-frame,keyframe", model="oracle", keyframes=f"every:{EVERY}", propagation="hold")
MS = 1_000_000
COSTS = {"segment": 130 * MS, "register": 8 * MS, "propagate": 3 * MS, "fuse": 20 * MS}
"""The network takes longer than the period, so that frames are dropped and answers are late."""


@dataclass(frozen=True, eq=False)
class Played:
    """What one replay found.

    Args:
        runs: mode -> its part of the report.
        points: mode -> the map; None without one.
    """

    runs: dict[str, dict[str, Any]]
    points: dict[str, LabelledPoints | None]


def play(log: Log) -> Played:
    """Replay `log` in both modes."""
    model = build_model(log, CONFIG)
    costs = Costing("constant", lambda mode: ConstantCosts(COSTS), None, None)
    replayed = replay_log(log, CONFIG, model, costs.of, lambda done, total: None)
    context = Context(log, CONFIG, model, costs, replayed)
    found = [scored(run) for run in replayed.runs]
    parts = [part(context, one, found[0]) for one in found]
    return Played(
        {run.mode: run.model_dump() for run in parts},
        {run.mode.name: run.cloud.points if run.cloud is not None else None for run in replayed.runs},
    )
