"""A network in int8: a second ONNX file, `name.int8.onnx` beside `name.onnx`, under the same sidecar."""

import hashlib
from dataclasses import replace
from pathlib import Path

from stsem.errors import NetworkError, UsageError
from stsem.inference.backends import read_signature
from stsem.inference.network import SHIPPED, VARIANT_SUFFIX, Network

INT8 = "int8"
MADE_FROM = "stsem.quantized_from"
"""Metadata key of a variant: `Network.sha256` of the network it was made from, sidecar included."""


def variant_path(network: Network) -> Path:
    """Where the int8 variant of a network is looked for, and where `stsem quantize` puts it."""
    return network.path.with_suffix(VARIANT_SUFFIX)


def at_precision(network: Network, precision: str) -> Network:
    """What runs for `precision`: the variant for int8, the network itself for everything else.

    The variant's file has a sum of its own, so results, costs and cached outputs of the two never meet.

    Raises:
        NetworkError: there is no variant, or it was made from another network.
        UsageError: `network` is a variant already, and another precision is asked for.
    """
    if network.precision == INT8 and precision != INT8:
        raise UsageError(f"{network.path} is an int8 variant; it cannot run in {precision}.")
    if precision != INT8 or network.precision == INT8:
        return network
    path = variant_path(network)
    if not path.is_file():
        raise NetworkError(f"The network {network.name} has no int8 variant {path.name} beside it; {_advice(network)}.")
    made_from = read_signature(path).metadata.get(MADE_FROM)
    if made_from != network.sha256:
        raise NetworkError(
            f"The int8 variant {path} was made from another network than {network.path.name} and its sidecar are now; "
            f"{_advice(network)}."
        )
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as err:
        raise NetworkError(f"{path} cannot be read: {err.strerror}.") from err
    return replace(network, path=path, model_sha256=digest, precision=INT8)


def _advice(network: Network) -> str:
    shown = network.name if network.path.parent == SHIPPED else network.path
    return f"make it with: stsem quantize {shown} --log LOG"
