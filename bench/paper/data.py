"""The data sets that the tables can be made of: each becomes three folders of small pairs, once."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from bench.paper import recorded
from bench.paper.problem import Place, Problem, find
from stsem.classes import ClassSet
from stsem.convert.cityscapes import CLASSES as CITYSCAPES
from stsem.errors import UsageError
from stsem.inference.sidecar import Difference, Sidecar
from stsem.synth.vocabulary import OFFICE
from stsem.train.dataset import PairFolder, Pairs
from stsem.train.recipe import RECIPES, Recipe

MEAN, STD, SCALE = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225), 4.0
SETS = ("train", "validation", "test")

Say = Callable[[str], None]


@dataclass(frozen=True)
class Layouts:
    """Layouts [first, end) of a set of rendered offices, and pairs of each."""

    first: int
    end: int
    pairs: int


OFFICES = {
    "train": Layouts(20000, 20400, 5), "validation": Layouts(21000, 21020, 4), "test": Layouts(22000, 22060, 4),
}  # fmt: skip
OFFICE_SIZE = (240, 135)


@dataclass(frozen=True)
class Data:
    """A data set, where its pairs lie, and the numbers of its trainings.

    Args:
        name: of the set.
        folder: holds the folders of `SETS`; "validation" may be missing.
        source: what the pairs are made from; None for rendered offices.
        classes: ids of all labels.
        size: (width, height) of the networks' input, 48 k - 7.
        wrong: the two classes of the "problem", as floor and lamp of the paper.
        place: where its problem image is looked for.
        iterations: of a first training, and of a second.
        depth: whether pairs have it.
    """

    name: str
    folder: Path
    source: Path | None
    classes: ClassSet
    size: tuple[int, int]
    wrong: tuple[str, str]
    place: Place
    iterations: tuple[int, int]
    depth: bool = False

    @property
    def sidecar(self) -> Sidecar:
        """How every network's inputs are formed."""
        return Sidecar(self.size, MEAN, STD, self.classes, Difference(SCALE))

    @property
    def recipe(self) -> Recipe:
        """`scratch` at this size; its fused numbers are those of every second training."""
        first, second = self.iterations
        return replace(
            RECIPES["scratch"], name="tables", crop=self.size, iterations=first, fused_iterations=second, warm_up=100,
        )  # fmt: skip

    def pairs(self, which: str) -> Pairs:
        """The pairs of one of `SETS`. Raises TrainingError when there are none."""
        return PairFolder(self.folder / which)

    def names(self) -> list[str]:
        """Of the training pairs, in their order."""
        return sorted(path.stem for path in (self.folder / "train").glob("*.npz"))

    def problem(self) -> Problem:
        """What is wrong in the "problem" set of this data."""
        floor, lamp = (self.classes.names.index(name) for name in self.wrong)
        may_be = _on_a_walk if self.name == "offices" else lambda _: True
        return find(self.pairs("train"), self.names(), floor, lamp, self.place, may_be)

    def prepare(self, say: Say) -> None:
        """Render or convert whatever is missing; a stopped one goes on. Raises StsemError."""
        if self.name == "offices":
            render_offices(self.folder, say)
        elif self.source is not None:
            recorded.SOURCES[self.name](self.source, self.folder, say)


def find_data(given: str, out: Path, offices: Path) -> Data:
    """The data set of `NAME` or `NAME=PATH`, its pairs under `out`, those of offices in a folder of their own.

    Raises:
        UsageError: there is no such set, or it needs a path.
    """
    name, _, path = given.partition("=")
    if name not in _DATA:
        raise UsageError(f"There is no data set {name!r}; choose offices, camvid=LOG.mcap or cityscapes=FOLDER.")
    if name != "offices" and not path:
        raise UsageError(f"The data set {name} has to be at hand: give --data {name}=PATH.")
    if name == "offices":
        return replace(_DATA[name], folder=Path(path) if path else offices)
    return replace(_DATA[name], folder=out / "pairs" / name, source=Path(path))


_NOWHERE = Path()
_DATA = {
    "offices": Data(
        "offices", _NOWHERE, None, OFFICE, (233, 137), ("floor", "lamp"), Place(0, 0), (800, 250), depth=True
    ),
    "camvid": Data("camvid", _NOWHERE, None, recorded.CAMVID, (185, 137), ("Road", "Pole"), Place(1, 1), (300, 100)),
    "cityscapes": Data(
        "cityscapes", _NOWHERE, None, CITYSCAPES, (281, 137), ("road", "pole"), Place(1, None), (1200, 400)
    ),
}


def render_offices(folder: Path, say: Say) -> None:
    """Render what is missing of the layouts in docs/paper-tables.md. Raises MissingExtraError without `synth`."""
    from bench.render_pairs import render

    for which, layouts in OFFICES.items():
        (folder / which).mkdir(parents=True, exist_ok=True)
        for layout in range(layouts.first, layouts.end):
            if not (folder / which / f"{layout:05}_{layouts.pairs - 1:02}.npz").exists():
                say(f"rendering {which}: layout {layout} of {layouts.first} to {layouts.end - 1}")
                render(layout, layouts.pairs, folder / which, OFFICE_SIZE, depth=True)


def _on_a_walk(stem: str) -> bool:
    """Whether bench/render_pairs.py put the pair `LAYOUT_PAIR` on a walk: every even one."""
    return int(stem.partition("_")[2]) % 2 == 0
