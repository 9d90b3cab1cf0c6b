"""Colour, then difference, then both: what each stage begins with, for each recipe."""

from dataclasses import fields, replace
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.errors import TrainingError, UsageError
from stsem.inference.sidecar import DepthForm
from stsem.models.zoo import ALIASES, ZOO, build
from stsem.train.checkpoint import averaged_weights, read_checkpoint
from stsem.train.dataset import PairFolder
from stsem.train.job import Job, stages_of
from stsem.train.loop import Training
from stsem.train.recipe import RECIPES, Recipe, find_recipe, with_assignments
from stsem.train.stages import train_stage
from stsem.train.starts import begin

from .squares import PAPER, SCRATCH, SIDECAR, short, write_squares

pytestmark = pytest.mark.torch


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> PairFolder:
    """Six pairs with depth."""
    return write_squares(tmp_path_factory.mktemp("pairs"), 6, depth=True)


def _trained(recipe: Recipe, pairs: PairFolder, folder: Path, architecture: str) -> dict[str, Path]:
    done: dict[str, Path] = {}
    for stage, name in stages_of(architecture):
        done[stage] = train_stage(Job(name, stage, SIDECAR, recipe, starts=dict(done)), pairs, None, folder / stage,
                                  lambda _: None)  # fmt: skip
    return done


@pytest.mark.parametrize("recipe", [short(SCRATCH, 2), short(PAPER, 2)], ids=["scratch", "paper"])
def test_every_stage_begins_with_the_one_before(recipe: Recipe, pairs: PairFolder, tmp_path: Path) -> None:
    """The difference stream with the colour stream's weights, adapted; the fused network with both streams'."""
    done = _trained(recipe, pairs, tmp_path, "pspnet-r18-feature-sum-w1")
    colour, difference = (averaged_weights(read_checkpoint(done[stage])) for stage in ("colour", "difference"))
    job = Job("pspnet-r18-temporal-w1", "difference", SIDECAR, recipe, starts={"colour": done["colour"]})
    network = build(job.architecture, 3)
    begun = begin(network, job, SIDECAR, pairs)
    began = network.state_dict()
    assert (begun.given, begun.new) == (True, frozenset())
    assert torch.equal(began["difference.head.0.weight"], colour["colour.head.0.weight"])
    stem = "backbone.stem.0.weight"
    torch.testing.assert_close(began[f"difference.{stem}"], colour[f"colour.{stem}"] / (0.25 * 4.0))
    assert began["difference.backbone.stem.1.num_batches_tracked"] == 64
    together = build("pspnet-r18-feature-sum-w1", 3)
    job = Job("pspnet-r18-feature-sum-w1", "fused", SIDECAR, recipe, starts=done)
    begun = begin(together, job, SIDECAR, pairs)
    own = dict(together.named_parameters())
    assert torch.equal(own[f"colour.{stem}"], colour[f"colour.{stem}"])
    assert torch.equal(own[f"difference.{stem}"], difference[f"difference.{stem}"])
    assert begun.new == {name for name in own if name.startswith("fused.")}


def test_statistics_of_the_first_difference_normalisation_are_those_of_the_data(
    pairs: PairFolder, tmp_path: Path
) -> None:
    """With them its outputs have a mean near 0 and a spread near 1; with the colour stream's they would not."""
    done = train_stage(Job("pspnet-r18-spatial-w1", "colour", SIDECAR, short(SCRATCH, 2)), pairs, None, tmp_path,
                       lambda _: None)  # fmt: skip
    job = Job("pspnet-r18-temporal-w1", "difference", SIDECAR, SCRATCH, starts={"colour": done})
    network = build(job.architecture, 3).eval()
    begin(network, job, SIDECAR, pairs)
    first = network.get_submodule("difference.backbone.stem.1")
    zero = network.get_submodule("difference.backbone.stem.0")(torch.zeros(1, 3, 41, 89))
    assert first.running_mean.abs().max() < 0.2  # type: ignore[union-attr,operator]
    assert torch.equal(zero, torch.zeros_like(zero))
    assert (first.running_var != 1).all()  # type: ignore[union-attr]


def test_given_weights_keep_their_statistics_and_new_layers_learn_faster(pairs: PairFolder, tmp_path: Path) -> None:
    """Recipe `paper`: with given weights normalisation is frozen, and a new layer moves ten times as far."""
    source = train_stage(Job("pspnet-r18-spatial-w1", "colour", SIDECAR, short(SCRATCH, 2)), pairs, None,
                         tmp_path / "a", lambda _: None)  # fmt: skip
    job = Job("pspnet-r18-spatial-w1", "colour", SIDECAR, replace(PAPER, batch=1), starts={"weights": source})
    before = averaged_weights(read_checkpoint(source))
    after = averaged_weights(read_checkpoint(train_stage(job, pairs, None, tmp_path / "b", lambda _: None)))
    statistics = [name for name in before if "running" in name]
    assert statistics
    assert all(torch.equal(before[name], after[name]) for name in statistics)
    assert not torch.equal(before["colour.head.0.weight"], after["colour.head.0.weight"])
    network, new = build(job.architecture, 3), frozenset({"colour.head.4.weight"})
    training = Training(network, SIDECAR, torch.ones(3), PAPER, job.machine, seed=0, new=new, frozen=True)
    still = {name: value.detach().clone() for name, value in network.named_parameters()}
    training.step(pairs)
    training.close()
    for name, factor in (("colour.head.4.weight", 10.0), ("colour.head.4.bias", 1.0)):
        value = network.get_parameter(name)
        assert value.grad is not None
        decayed = value.grad + PAPER.decay * still[name]
        torch.testing.assert_close(value, still[name] - factor * PAPER.rate * decayed)


def test_tiny_batches_need_frozen_normalisation(pairs: PairFolder, tmp_path: Path) -> None:
    """One view has no spread to normalise by."""
    job = Job("pspnet-r18-spatial-w1", "colour", SIDECAR, replace(SCRATCH, batch=1))
    with pytest.raises(TrainingError, match="Batches of one view"):
        train_stage(job, pairs, None, tmp_path, lambda _: None)


def test_parameters_that_no_loss_reaches_do_not_matter(pairs: PairFolder) -> None:
    """A layer that is not used keeps its values, in either worker."""
    network = build("pspnet-r18-spatial-w1", 3)
    network.add_module("idle", torch.nn.Linear(2, 2))
    before = network.get_parameter("idle.weight").detach().clone()
    training = Training(network, SIDECAR, torch.ones(3), SCRATCH, Job("", "colour", SIDECAR, SCRATCH).machine, seed=0)
    training.step(pairs)
    training.close()
    assert torch.equal(network.get_parameter("idle.weight"), before)
    assert network.get_parameter("idle.weight").grad is None


def test_networks_with_depth_and_without_a_difference(pairs: PairFolder, tmp_path: Path) -> None:
    """Depth comes with the pairs or is missed; a difference must be described."""
    job = Job("fusenet-w1", "colour", SIDECAR, replace(short(SCRATCH, 1), crop=(32, 32)))
    assert train_stage(job, pairs, None, tmp_path / "a", lambda _: None).is_file()
    without = write_squares(tmp_path / "without", 2)
    with pytest.raises(TrainingError, match=r"takes 'depth', which these pairs"):
        train_stage(
            replace(job, sidecar=replace(SIDECAR, depth=DepthForm())), without, None, tmp_path / "b", lambda _: None
        )
    still = Job("pspnet-r18-temporal-w1", "difference", replace(SIDECAR, difference=None), SCRATCH)
    with pytest.raises(TrainingError, match=r"takes the difference, which the sidecar does not describe"):
        train_stage(still, pairs, None, tmp_path / "c", lambda _: None)


def test_weights_that_do_not_fit(pairs: PairFolder, tmp_path: Path) -> None:
    """Another width, or streams for a network without any."""
    done = train_stage(Job("pspnet-r18-spatial-w2", "colour", SIDECAR, short(SCRATCH, 1)), pairs, None, tmp_path,
                       lambda _: None)  # fmt: skip
    job = Job("pspnet-r18-temporal-w1", "difference", SIDECAR, SCRATCH, starts={"colour": done})
    with pytest.raises(TrainingError, match="do not fit pspnet-r18-temporal-w1"):
        begin(build(job.architecture, 3), job, SIDECAR, pairs)
    with pytest.raises(TrainingError, match="has no difference stream"):
        begin(build("fcn-32s-w1", 3), replace(job, architecture="fcn-32s-w1"), SIDECAR, pairs)


@pytest.mark.parametrize("name", [*ZOO, *ALIASES])
def test_every_architecture_has_stages(name: str) -> None:
    """The last stage is the network itself; two streams are trained first where there are two."""
    stages = stages_of(f"{name}-w2")
    assert stages[-1][1] == f"{name}-w2"
    with torch.device("meta"):
        network = build(f"{name}-w1", 2)
    assert len(stages) == (3 if network.inputs == ("image", "difference") else 1)


def test_stages_keep_widths_and_stems() -> None:
    """Colour first."""
    assert stages_of("pspnet-r18-max-7x7-w4-w2") == (
        ("colour", "pspnet-r18-spatial-7x7-w4"), ("difference", "pspnet-r18-temporal-7x7-w2"),
        ("fused", "pspnet-r18-max-7x7-w4-w2"),
    )  # fmt: skip


def test_the_papers_numbers() -> None:
    """Section "Training Details"; the fall of the rate by hand."""
    paper = RECIPES["paper"]
    assert (paper.rate, paper.fused_rate, paper.power, paper.decay, paper.momentum) == (2.5e-4, 1e-4, 0.9, 1e-4, 0.9)
    assert (paper.iterations, paper.batch, paper.fused_batch, paper.crop) == (20_000, 3, 1, (521, 521))
    assert (paper.scales, paper.of_image, paper.mirror, paper.optimiser) == ((0.5, 2.0), True, True, "sgd")
    assert paper.rate_at(10_000) == pytest.approx(2.5e-4 * 0.5**0.9)
    assert paper.fused().rate_at(0) == 1e-4
    assert RECIPES["scratch"].rate_at(0) == pytest.approx(2e-3 / 200)


def test_the_document_states_the_recipes() -> None:
    """Every number of docs/train.md is the one that is used, and none is left out."""
    text = (Path(__file__).parents[2] / "docs" / "train.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")
    ]
    stated = {row[0]: row[1:] for row in rows[rows.index(["number", "`paper`", "`scratch`"]) + 1 :]}
    apart = {"name", "pretrained", "checkpoint_every", "report_every", "validate_every"}
    assert stated == {
        key: [_in_words(getattr(recipe, key)) for recipe in (RECIPES["paper"], RECIPES["scratch"])]
        for key in (field.name for field in fields(Recipe)) if key not in apart
    }  # fmt: skip


def _in_words(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ("x" if isinstance(value[0], int) else " to ").join(f"{part:g}" for part in value)
    return f"{value:.7g}" if isinstance(value, float) else str(value)


@pytest.mark.parametrize(("text", "sentence"), [
    ('base = "scratch"\nitrations = 5', "unknown key 'itrations'; did you mean 'iterations'?"),
    ('base = "best"', "base = 'best'; write base = 'paper' or 'scratch'"), ("base = []", "base = []; write base"),
    ('base = "paper"\nrate = "fast"', "rate = 'fast'; expected a value like"),
    ('base = "paper"\ncrop = [1]', "crop = [1]"), ('base = "paper"\nbatch = 0', "batch = 0; it must be at least 1"),
    ('base = "paper"\nscales = [2, 1]', "smallest, largest"), ("base = ", "not valid TOML"),
    ('base = "paper"\noptimiser = "lion"', "choose 'sgd' or 'adamw'"), ('base = "paper"\nscales = [1, inf]', "above 0"),
    ('base = "paper"\nmomentum = 5', "momentum = 5.0; it must be at most 1"),
    ('base = "paper"\nscales = [1]', "expected a value like [1.0, 2.0]"),
    ('base = "paper"\nlight = 1', "expected a value like true"),
])  # fmt: skip
def test_recipes_in_files_that_cannot_be(tmp_path: Path, text: str, sentence: str) -> None:
    """One sentence."""
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(UsageError) as said:
        find_recipe(str(path))
    assert sentence in str(said.value)


def test_a_recipe_in_a_file(tmp_path: Path) -> None:
    """The base with what differs, integers for floats, too."""
    path = tmp_path / "own.toml"
    path.write_text('base = "scratch"\niterations = 7\nrate = 1\nscales = [1, 1.5]\ncrop = [41, 41]\n')
    expected = replace(RECIPES["scratch"], name="own", iterations=7, rate=1.0, scales=(1.0, 1.5), crop=(41, 41))
    assert find_recipe(str(path)) == expected
    for name in ("best", str(tmp_path / "none.toml")):
        with pytest.raises(UsageError):
            find_recipe(name)


def test_assignments() -> None:
    """Values as in TOML."""
    scratch = RECIPES["scratch"]
    changed = with_assignments(scratch, ["scales=[1, 1.7]", "warm_up = 50", 'optimiser="sgd"'])
    assert changed == replace(scratch, scales=(1.0, 1.7), warm_up=50, optimiser="sgd")
    for text, sentence in (("warm_up", "KEY=VALUE"), ("warmup=5", "did you mean 'warm_up'"), ("batch=1.5", "like 8")):
        with pytest.raises(UsageError, match=sentence):
            with_assignments(scratch, [text])
