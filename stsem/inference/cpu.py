"""What the processor can do: floats differ between kinds of it, so a result carries this (DESIGN 3, same bytes)."""

import functools
import platform
import re
from pathlib import Path

_CPUINFO = Path("/proc/cpuinfo")
_VECTOR = re.compile(r"(ss?se|avx|amx|fma|f16c|asimd|neon|sve|bf16|i8mm|fphp)\w*|sme(2|_\w+)?")


@functools.cache
def cpu_features() -> tuple[str, ...]:
    """Architecture first, then the vector instruction sets, sorted; from /proc/cpuinfo, else numpy's own probing."""
    flags = _from_cpuinfo(_CPUINFO.read_text(errors="replace")) if _CPUINFO.is_file() else _from_numpy()
    return (platform.machine().lower() or "unknown", *sorted(flags))


def _from_cpuinfo(text: str) -> set[str]:
    """Flags of the first processor (x86 writes `flags`, ARM writes `Features`) that change how floats are computed."""
    for line in text.splitlines():
        key, _, value = line.partition(":")
        if key.strip().lower() in ("flags", "features"):
            return {flag for flag in value.split() if _VECTOR.fullmatch(flag)}
    return set()


def _from_numpy() -> set[str]:
    from numpy.lib import introspect

    targets = introspect.opt_func_info(func_name="^add$", signature="float32")
    chosen = {kind["current"] for by_type in targets.values() for kind in by_type.values()}
    return {word.lower() for name in chosen for word in name.split()}
