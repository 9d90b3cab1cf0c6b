"""What still waited for a core when a run ended: work beside the answers has no outcome that would say so."""

from collections import Counter

from stsem.replay.lanes import ModeRun
from stsem.replay.runs import Context, fusable
from stsem.result import Outcome

_NEVER_CAME = (Outcome.UNDECODABLE, Outcome.INCOMPLETE)


def fell_behind(context: Context, run: ModeRun) -> list[str]:
    """One sentence for each stage beside the answers that was not done with the frames; none without a clock."""
    if run.real_time is None:
        return []
    begun = Counter(span.stage for span in run.spans)
    frames = sum(result.outcome not in _NEVER_CAME for result in run.real_time.results)
    keyframes = sum(fusable(context, run, index) for index in run.keyframes)
    untracked = 0 if run.tracker is None else frames - begun["track"]
    unfused = 0 if run.cloud is None else keyframes - begun["fuse"]
    said = []
    if untracked > 0:
        said.append(
            f"{run.mode.name} fell behind: {untracked} of {frames} frames were not tracked yet when the run ended; "
            "trajectory.txt and its errors contain them."
        )
    if unfused > 0:
        said.append(
            f"{run.mode.name}: {unfused} of {keyframes} keyframes are not in the map; it had not come to them when the "
            "run ended, or their depth cannot be used."
        )
    return said
