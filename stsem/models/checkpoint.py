"""Weights from elsewhere into a network of ours; what fits where is told by names and shapes."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor, nn

from stsem.errors import NetworkError, UsageError
from stsem.models.names import FAMILIES, OURS, Family, family_of
from stsem.models.network import SegmentationNetwork
from stsem.models.pspnet import PSPNet
from stsem.models.two_stream import adapt_to_difference
from stsem.models.weightfile import Weights, read_weights

Stream = Literal["colour", "difference"]
STREAMS: tuple[Stream, ...] = ("colour", "difference")
_COUNTER = ".num_batches_tracked"
"""What older torch does not save; it plays no part in an answer."""


@dataclass(frozen=True)
class LoadedWeights:
    """What became of the weights of a file.

    Args:
        family: whose names they have.
        matched: names of the network's weights that were taken from the file.
        missing: those that are not in it; they stay as they were.
        unfit: those whose number of classes is another one, with both shapes; they stay as they were.
        unmatched: names in the file that have no place in the network, as a ResNet's own classifier.
        adapt: a colour stream's weights stand in the difference stream as they are; see `begin_with`.
        note: what else to know, or "".
    """

    family: str
    matched: tuple[str, ...]
    missing: tuple[str, ...]
    unfit: tuple[str, ...]
    unmatched: tuple[str, ...]
    adapt: bool = False
    note: str = ""

    @property
    def complete(self) -> bool:
        """Whether everything that an answer needs was taken; heads that serve the loss alone do not count."""
        return all("auxiliary" in name.split(".") for name in (*self.missing, *self.unfit))

    def lines(self) -> list[str]:
        """For people: counts, the first names of each kind, the note."""
        total = len(self.matched) + len(self.missing) + len(self.unfit)
        kinds = (
            ("not in the file, unchanged", self.missing), ("made for other classes, unchanged", self.unfit),
            ("in the file, but without a place", self.unmatched),
        )  # fmt: skip
        lines = [f"{len(self.matched)} of {total} taken ({self.family})"]
        lines += [f"{len(names)} {what}: {shortened(names)}" for what, names in kinds if names]
        return [*lines, self.note] if self.note else lines


def shortened(names: tuple[str, ...] | list[str], shown: int = 3) -> str:
    """The first names, and how many more there are."""
    more = len(names) - shown
    return ", ".join(names[:shown]) + (f" and {more} more" if more > 0 else "")


def load_weights(network: SegmentationNetwork, path: Path, *, stream: Stream | None = None) -> LoadedWeights:
    """Put the weights of a file into `network`, in place.

    Args:
        network: of the zoo.
        path: a file of `torch.save`: one of our checkpoints, or a state dict with the names of `FAMILIES`, alone or
            under a key such as `state_dict`.
        stream: which stream of the network the weights of a single stream are for; None for its first.

    Raises:
        NetworkError: the file cannot be read, its names are unknown, or its weights are of another depth, width or
            stem. The network is unchanged then.
        UsageError: the network has no such stream.
    """
    weights, own = read_weights(path), network.state_dict()
    family = family_of(weights.keys(), own.keys())
    if family is None:
        raise NetworkError(f"The weights {path} have names that are not known ({shortened(list(weights))}); known are "
                           f"this network's own and those of: {'; '.join(row.title for row in FAMILIES)}.")  # fmt: skip
    prefix = _place(own, family, stream, path)
    came = _streams(weights)
    named = {_renamed(key, family, prefix, came): key for key in weights}
    taken = {name: key for name, key in named.items() if name in own}
    misfits = {name: key for name, key in taken.items() if own[name].shape != weights[key].shape}
    missing = tuple(name for name in own if name not in taken and not name.endswith(_COUNTER))
    left = {name: key for name, key in named.items() if name not in own and not key.endswith(_COUNTER)}
    _check_shapes(weights, own, misfits, family, path)
    if family is not OURS:
        _check_depth(f"{prefix}backbone.", missing, left, family, path)
    fits = {name: weights[key] for name, key in taken.items() if name not in misfits}
    _check_values(fits, path)
    network.load_state_dict(fits, strict=False)
    return LoadedWeights(
        family.title, tuple(name for name in fits if not name.endswith(_COUNTER)), missing,
        tuple(f"{key} {_shape(weights[key])} for {_shape(own[name])}" for name, key in misfits.items()),
        tuple(left.values()), adapt=prefix == "difference." and "difference" not in came,
    )  # fmt: skip


def begin_with(
    network: SegmentationNetwork, path: Path, *, std: tuple[float, float, float], scale: float | None
) -> LoadedWeights:
    """The same, and a difference stream for which the file has nothing starts from the colour stream's weights.

    Args:
        network, path: as for `load_weights`.
        std, scale: as for `copy_colour_to_difference`; without a scale the difference stream is left alone.

    Raises:
        NetworkError: as `load_weights`.
    """
    loaded = load_weights(network, path)
    streams: dict[str, nn.Module] = dict(network.named_children())
    colour, difference = streams.get("colour"), streams.get("difference")
    if scale is None or not isinstance(difference, PSPNet):
        return loaded
    if not loaded.adapt:
        if colour is None or any(name.startswith("difference.") for name in loaded.matched):
            return loaded
        try:
            difference.load_state_dict(colour.state_dict())
        except RuntimeError:
            return replace(loaded, note="The difference stream has another width than the colour's and is unchanged.")
    adapt_to_difference(difference, std=std, scale=scale)
    taken = {f"difference.{name.removeprefix('colour.')}" for name in loaded.matched if name.startswith("colour.")}
    copied = tuple(name for name in loaded.missing if name in taken)  # no copy of what is random in the colour stream
    return replace(
        loaded, matched=(*loaded.matched, *copied), missing=tuple(x for x in loaded.missing if x not in copied),
        adapt=False, note="The difference stream starts from a colour stream's weights; train it before use.",
    )  # fmt: skip


def _streams(names: Mapping[str, object]) -> list[Stream]:
    return [name for name in STREAMS if any(key.startswith(f"{name}.") for key in names)]


def _place(own: Mapping[str, Tensor], family: Family, stream: Stream | None, path: Path) -> str:
    """What stands before the names of the stream that is to be filled: "colour.", "difference." or nothing."""
    there = _streams(own)
    if stream is not None and stream not in there:
        raise UsageError(f"The network has no stream {stream!r} for {path}; it has {', '.join(there) or 'none'}.")
    if family is not OURS and not any(name.endswith("backbone.stem.0.weight") for name in own):
        raise NetworkError(f"The weights {path} ({family.title}) are of a ResNet, which the network does not contain; "
                           "choose a pspnet-* or deeplab-v2.")  # fmt: skip
    wanted = stream or (there[0] if there else None)
    return f"{wanted}." if wanted else ""


def _renamed(key: str, family: Family, prefix: str, came: list[Stream]) -> str:
    """The network's name; of our own files only those of a single stream change, if another one is to be filled."""
    if family is not OURS:
        return prefix + family.rename(key)
    return re.sub(rf"^{came[0]}\.", prefix, key) if prefix and len(came) == 1 else key


def _check_shapes(
    weights: Weights, own: Mapping[str, Tensor], misfits: Mapping[str, str], family: Family, path: Path
) -> None:
    """Shapes may differ by the number of classes alone: one number in place of another, and outside any backbone."""
    pairs = {
        pair for name, key in misfits.items()
        for pair in zip(own[name].shape, weights[key].shape, strict=False) if pair[0] != pair[1]
    }  # fmt: skip
    deep = [name for name, key in misfits.items() if "backbone" in name or own[name].dim() != weights[key].dim()]
    if len(pairs) <= 1 and not deep:
        return
    name = (deep or list(misfits))[0]
    advice = "give weights of the same depth and width"
    if family.stem == 7 and name.endswith("backbone.stem.0.weight"):
        advice = "for this stem, choose an architecture with -7x7 in its name, as pspnet-r50-sum-7x7"
    elif family.stem == 3 and own[name].shape[-1] == 7:
        advice = "for this stem, choose an architecture without -7x7 in its name"
    key = misfits[name]
    raise NetworkError(f"The weights {path} ({family.title}) do not fit: {key} is {_shape(weights[key])}, and the "
                       f"network has {_shape(own[name])} there; {advice}.")  # fmt: skip


def _check_depth(backbone: str, missing: tuple[str, ...], left: Mapping[str, str], family: Family, path: Path) -> None:
    """A backbone comes whole, or its depth is another one."""
    lacking = [name for name in missing if name.startswith(backbone)]
    more = [key for name, key in left.items() if name.startswith(backbone)]
    if lacking or more:
        what = f"lack {shortened(lacking)}" if lacking else f"also hold {shortened(more)}"
        raise NetworkError(f"The weights {path} ({family.title}) are of another depth than the network: they {what}.")


def _check_values(fits: Mapping[str, Tensor], path: Path) -> None:
    for name, value in fits.items():
        if value.is_complex() or not torch.isfinite(value).all():
            raise NetworkError(f"The weights {path} hold values for {name} that are no finite numbers; "
                               "the training that made them has failed.")  # fmt: skip


def _shape(value: Tensor) -> str:
    return "x".join(map(str, value.shape)) or "a number"
