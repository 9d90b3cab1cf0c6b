"""An inspection as text for a terminal."""

from tabulate import tabulate

from stsem.log.inspect import Inspection

_NONE = "–"


def inspection_text(found: Inspection) -> str:
    """Tables of channels, use, frames, truth and depth; warnings at the end."""
    sections = [
        _head(found), _channels(found), _used(found), _frames(found), _truth(found), _depth(found), _warnings(found),
    ]  # fmt: skip
    return "\n\n".join(section for section in sections if section) + "\n"


def _head(found: Inspection) -> str:
    log = found.log
    return (
        f"{log.name}: {log.size_bytes / 1e6:.1f} MB, {log.duration_s:.1f} s, profile {log.profile or 'none'}, "
        f"written by {log.library or 'unknown'}\nsha256 {log.sha256}"
    )


def _channels(found: Inspection) -> str:
    headers = ["topic", "schema", "encoding", "messages", "Hz", "largest gap", "log - stamp min/median", "used as"]
    rows = [
        [
            c.topic, c.schema, c.encoding, c.count, _number(c.rate_hz, "{:.2f}"), _number(c.largest_gap_s, "{:.3f} s"),
            f"{_ms(c.offset_min_ns)} / {_ms(c.offset_median_ns)}", c.role or _NONE,
        ]
        for c in found.channels
    ]  # fmt: skip
    return tabulate(rows, headers, disable_numparse=True)


def _used(found: Inspection) -> str:
    rows = [[role, topic or "nothing: no such channel"] for role, topic in found.used.items()]
    return tabulate(rows, ["for", "stsem-replay would use"], disable_numparse=True)


def _frames(found: Inspection) -> str:
    f, camera = found.frames, found.camera
    lines = [
        f"Frames: {f.count} of {f.width}x{f.height} every {f.period_ms:.1f} ms; with depth {f.with_depth}, with pose "
        f"{f.with_pose}, with truth {f.with_truth}; {f.undecodable} of {f.looked_at} looked at cannot be decoded"
    ]
    if camera is None:
        lines.append("Camera: no intrinsics")
    else:
        lines.append(f"Camera: fx {camera['fx']} fy {camera['fy']} cx {camera['cx']} cy {camera['cy']} px")
    lines += [f"Clock: {ns / 1e6:+.1f} ms taken out of {topic}" for topic, ns in found.clock_offsets_ns.items()]
    return "\n".join(lines)


def _truth(found: Inspection) -> str:
    if found.truth is None:
        return "Truth: none; accuracy cannot be measured"
    rows = [[c.id, c.name, c.pixels, _number(c.share, "{:.2%}")] for c in found.truth.classes]
    ignored = _number(found.truth.ignored_share, "{:.2%}")
    return (
        f"Truth in {found.truth.frames} frames looked at; {ignored} of the pixels ignored\n"
        + tabulate(rows, ["id", "class", "pixels", "share of labelled"], disable_numparse=True,
                   colalign=("right", "left", "right", "right"))
    )  # fmt: skip


def _depth(found: Inspection) -> str:
    if found.depth is None:
        return "Depth: none"
    marks = ", ".join(f"{p} % {metres:.2f} m" for p, metres in found.depth.percentiles_m.items()) or "no known pixel"
    unknown = _number(found.depth.unknown_share, "{:.1%}")
    return f"Depth in {found.depth.frames} frames looked at: {marks}; {unknown} of the pixels unknown"


def _warnings(found: Inspection) -> str:
    lines = [f"Note: {warning}" for warning in found.warnings]
    if found.damage["lossy"]:
        lines.append(f"Damage: {found.damage_text}")
    return "\n".join(lines)


def _number(value: float | None, form: str) -> str:
    return _NONE if value is None else form.format(value)


def _ms(ns: int | None) -> str:
    return _NONE if ns is None else f"{ns / 1e6:.1f} ms"
