"""What a training runs on, chosen by what there is."""

import torch

from stsem.errors import UsageError
from stsem.inference.cpu import cpu_features
from stsem.train.job import Machine

DEVICES, PRECISIONS = ("auto", "cpu", "cuda"), ("auto", "f32", "bf16")
_BF16 = ("avx512_bf16", "amx_bf16", "bf16")
"""Processor features with which bfloat16 is faster than float32."""


def machine(device: str, precision: str, workers: int) -> Machine:
    """The machine for --device, --precision and --workers; "auto" takes a GPU, and bfloat16, where there is one.

    Raises:
        UsageError: a value that cannot be, or there is no such device.
    """
    for flag, value, known in (("--device", device, DEVICES), ("--precision", precision, PRECISIONS)):
        if value not in known:
            raise UsageError(f"{flag} takes {', '.join(known)}, but {value!r} came.")
    if workers < 1:
        raise UsageError(f"--workers is {workers}; it must be at least 1.")
    has_gpu = torch.cuda.is_available()
    if device == "cuda" and not has_gpu:
        raise UsageError("There is no GPU that torch can use; take --device cpu.")
    on_gpu = device == "cuda" or (device == "auto" and has_gpu)
    fast = on_gpu or any(feature in cpu_features() for feature in _BF16)
    return Machine("cuda" if on_gpu else "cpu", 1 if on_gpu else workers, 1,
                   precision == "bf16" or (precision == "auto" and fast))  # fmt: skip
