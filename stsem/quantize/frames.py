"""The frames that show a network's ranges."""

from collections.abc import Iterator, Sequence
from contextlib import closing

from stsem.errors import ChannelError, NetworkError
from stsem.frame import Frame
from stsem.inference.network import Network
from stsem.log.container.files import Given
from stsem.log.log import Log, open_log

_DEPTH = frozenset({"depth"})


def calibration_frames(network: Network, recordings: Sequence[Sequence[Given]], wanted: int) -> list[Frame]:
    """`wanted` frames, or as many as there are: equal shares of the recordings, evenly spread over each.

    Args:
        network: decides whether frames need depth; those without it are passed over.
        recordings: each the paths of one.
        wanted: frames in all.

    Raises:
        ChannelError: a log without depth for a network that takes it.
        NetworkError: not one frame can be used.
    """
    found: list[Frame] = []
    for place, paths in enumerate(recordings):
        share = wanted * (place + 1) // len(recordings) - wanted * place // len(recordings)
        with open_log(paths) as log:
            _check_depth(network, log)
            found += _spread(network, log, share)
    if not found:
        raise NetworkError(f"The logs have no frame that {network.name} can be calibrated on; give others.")
    return found


def _spread(network: Network, log: Log, share: int) -> Iterator[Frame]:
    """The middles of `share` equal stretches of the log; undecodable ones are passed over."""
    usable = [plan.index for plan in log.plans if not (network.has_depth and plan.missing(_DEPTH))]
    count = min(share, len(usable))
    indices = [usable[(2 * i + 1) * len(usable) // (2 * count)] for i in range(count)]
    with closing(log.frames(indices, depth=network.has_depth, previous=network.has_difference, truth=False)) as supply:
        yield from (loaded.frame for loaded in supply if loaded.frame is not None)


def _check_depth(network: Network, log: Log) -> None:
    if network.has_depth and log.info.choice.depth is None:
        raise ChannelError(
            f"The network {network.name} takes depth, but {log.info.name} has no depth channel that can be used; "
            "give logs that have one.",
            "depth",
        )
