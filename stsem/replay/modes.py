"""The ways of running the pipeline, as rows of a table (DESIGN 3)."""

from dataclasses import dataclass

from stsem.errors import UsageError

BOTH = "both"


@dataclass(frozen=True)
class Mode:
    """One way of answering frames.

    Args:
        name: as on the command line and in the report.
        segments_every_frame: no prediction: each taken frame goes through the network.
        network_cores: cores that the network claims while it runs, where `track` needs none.
        in_background: keyframes are segmented beside the answer path and answered by prediction, like every frame, so
            that no answer waits for the network. Without a clock nothing waits, and they are answered by the network.
    """

    name: str
    segments_every_frame: bool
    network_cores: int
    in_background: bool = False

    def cores(self, available: int, *, tracks: bool) -> int:
        """Cores that the network claims of those `available`; one where `track` works beside it (DESIGN 3)."""
        return 1 if tracks else min(self.network_cores, available)


MODES = {
    mode.name: mode
    for mode in (
        Mode("per-frame", segments_every_frame=True, network_cores=2),
        Mode("keyframe", segments_every_frame=False, network_cores=2),
        Mode("keyframe-async", segments_every_frame=False, network_cores=1, in_background=True),
    )
}


def parse_modes(text: str) -> tuple[Mode, ...]:
    """Modes named in a comma-separated list, in the table's order; `both` is per-frame and keyframe.

    Raises:
        UsageError: an unknown name, or none.
    """
    names = {name.strip() for name in text.split(",") if name.strip()}
    if BOTH in names:
        names = names - {BOTH} | {"per-frame", "keyframe"}
    if unknown := sorted(names - set(MODES)):
        raise UsageError(f"There is no mode {unknown[0]!r}; the modes are {', '.join(MODES)} and {BOTH}.")
    if not names:
        raise UsageError(f"No mode was given; the modes are {', '.join(MODES)} and {BOTH}.")
    return tuple(mode for name, mode in MODES.items() if name in names)
