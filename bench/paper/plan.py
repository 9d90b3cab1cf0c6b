"""Which trainings the tables are made of. A cell is one network, one dose of wrong labels and one seed."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bench.paper.problem import DOSES
from stsem.errors import UsageError

if TYPE_CHECKING:  # it would load torch, which only what trains needs
    from stsem.train.job import Stage

WIDTH = "w2"
"""An eighth of the papers' channels."""
TRAINED_ON = 1000
"""Added to the seed of a second training, or it would see the views of the first again."""


@dataclass(frozen=True)
class Network:
    """A training that the tables need.

    Args:
        architecture: of the zoo, with its width.
        pace: processor seconds of one iteration (batch 8, 233x137) on one thread of the machine that
            docs/paper-tables.md names; it weighs the time that is left, and nothing else.
        after: start, as `stsem.train.job` calls it -> the network whose weights it starts from; empty for a beginning.
        stage: as `stsem.train.job` calls it; "colour" also for all that is no two-stream network.
        second: it is trained on, for as long as the fused networks are.
    """

    architecture: str
    pace: float
    after: Mapping[str, str] = field(default_factory=dict)
    stage: "Stage" = "colour"
    second: bool = False


def _networks() -> dict[str, Network]:
    found: dict[str, Network] = {}
    for depth, stream_pace, fused_pace, fusions in PSPNETS:
        tail = "" if depth == 18 else f"-r{depth}"
        names = {part: f"{part}{tail}-first" for part in ("spatial", "temporal")}
        zoo = {part: f"pspnet-r{depth}-{part}-{WIDTH}" for part in ("spatial", "temporal", *fusions)}
        found[names["spatial"]] = Network(zoo["spatial"], stream_pace)
        found[names["temporal"]] = Network(zoo["temporal"], stream_pace, {"colour": names["spatial"]}, "difference")
        found[f"spatial{tail}"] = Network(zoo["spatial"], stream_pace, {"weights": names["spatial"]}, second=True)
        starts = {"colour": names["spatial"], "difference": names["temporal"]}
        for fusion in fusions:
            found[f"{fusion}{tail}"] = Network(zoo[fusion], fused_pace, starts, "fused", second=True)
    for name, pace in OTHERS.items():
        found[f"{name}-first"] = Network(f"{name}-{WIDTH}", pace)
        found[name] = Network(f"{name}-{WIDTH}", pace, {"weights": f"{name}-first"}, second=True)
    for name, (before, pace) in FIELDS.items():
        found[name] = Network(f"{name}-{WIDTH}", pace, {"weights": f"{before}-first"}, second=True)
    return found


PSPNETS: tuple[tuple[int, float, float, tuple[str, ...]], ...] = (
    (18, 0.10, 0.19, ("sum", "max", "feature-sum", "feature-concat")), (50, 0.18, 0.35, ("sum",)),
)  # fmt: skip
"""Depth of the backbone, pace of a stream and of both, fusions."""
OTHERS = {
    "fcn-32s": 0.15, "fcn-16s": 0.15, "fcn-8s": 0.15, "parsenet": 0.15, "segnet": 0.28, "segnet-basic": 0.25,
    "bayesian-segnet": 0.24, "deeplab-v2": 0.5, "fusenet": 0.28, "adapnet": 0.15, "adapnet-pp": 0.16,
    "adapnet-pp-ssma": 0.25,
}  # fmt: skip
FIELDS = {"deeplab-v2-crf": ("deeplab-v2", 3.0), "crf-rnn": ("fcn-8s", 2.9)}
"""A random field is put behind a network that was trained without one, as its paper does."""
NETWORKS = _networks()


@dataclass(frozen=True)
class Cell:
    """One network at one dose of wrong labels and one seed.

    Args:
        network: a name in `NETWORKS`.
        dose: of `DOSES`.
        seed: of the table.
    """

    network: str
    dose: str
    seed: int

    @property
    def key(self) -> str:
        """`sum-one/2`, as `--cell` takes it."""
        return f"{dosed(self.network, self.dose)}/{self.seed}"

    @property
    def file(self) -> str:
        """`sum-one-2`, the name of its folder and of its result."""
        return self.key.replace("/", "-")

    @property
    def what(self) -> Network:
        """How it is trained."""
        return NETWORKS[self.network]

    @property
    def starts(self) -> dict[str, "Cell"]:
        """Start -> the cell whose weights it begins with."""
        return {stream: Cell(name, self.dose, self.seed) for stream, name in self.what.after.items()}

    @property
    def training_seed(self) -> int:
        """Of the first weights, the order and the views."""
        return self.seed + (TRAINED_ON if self.what.second else 0)


def dosed(network: str, dose: str) -> str:
    """Name of a network at a dose: `sum`, `sum-one`."""
    return network if dose == "right" else f"{network}-{dose}"


def find_cell(key: str) -> Cell:
    """The cell of `NAME/SEED`. Raises UsageError."""
    name, _, seed = key.partition("/")
    for dose in DOSES:
        for network in NETWORKS:
            if dosed(network, dose) == name and seed.isdecimal():
                return Cell(network, dose, int(seed))
    raise UsageError(f"There is no cell {key!r}; give NAME/SEED, such as sum-one/0, from the list that --list prints.")


def with_starts(cells: Iterable[Cell]) -> list[Cell]:
    """The cells and all that they start from, each once and never before what it needs."""
    found: dict[Cell, None] = {}

    def add(cell: Cell) -> None:
        for start in cell.starts.values():
            add(start)
        found.setdefault(cell)

    for cell in cells:
        add(cell)
    return list(found)
