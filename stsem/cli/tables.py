"""An inspection as text for a terminal."""

import shutil
from collections.abc import Iterable, Iterator, Sequence
from textwrap import wrap

from tabulate import tabulate

from stsem.cli.columns import NONE, channel_table, number
from stsem.errors import ChannelError, ClassTableError, StsemError, UndecodableError
from stsem.log.container.damage import Damage
from stsem.log.doctor.inspection import Inspection
from stsem.log.info import ChannelInfo
from stsem.plain import MAX_SENTENCE, plain

WIDTH_WITHOUT_TERMINAL = 120
MIN_WIDTH = 60


def terminal_width() -> int:
    """Columns of the terminal, of COLUMNS, or 120."""
    return max(MIN_WIDTH, shutil.get_terminal_size((WIDTH_WITHOUT_TERMINAL, 0)).columns)


def inspection_text(found: Inspection, command: str, width: int, network: str | None = None) -> str:
    """Everything that was found, in lines of `width` where that goes; `command` replays the log as it was inspected,
    `network` is what there is to say of a network that was asked about."""
    return _joined([
        _head(found, width), channel_table(found.channels, width), _used(found), _facts(found, width), _truth(found),
        _findings(found, width), "\n".join(_wrapped("Network: ", [network] if network else [], width)),
        _verdict(found, command),
    ])  # fmt: skip


def network_line(name: str, inputs: Sequence[str], found: Inspection) -> str:
    """What the network `name` with `inputs` would be given of this log."""
    said, frames = f"{name} would be given {', '.join(inputs)}", found.frames
    if "depth" not in inputs or (lacking := frames.count - frames.with_depth) == 0:
        return said
    if found.depth is None:
        return f"{said}, but the log has no depth that can be used: a replay with it is refused"
    return f"{said}; {lacking} of {frames.count} frames have no depth, and are given it as unknown all over"


def unopened_text(channels: Sequence[ChannelInfo], damage: Damage, error: StsemError, width: int) -> str:
    """What is known of a log that cannot be opened as it was asked for."""
    table = channel_table(channels, width) if channels else "No channel."
    return _joined([table, *_wrapped("", [f"Damage: {damage}"], width)] if damage.lossy else [table]) + (
        f"\nNot usable as it is: {_why_not(error)}.\n"
    )


def _why_not(error: StsemError) -> str:
    if isinstance(error, UndecodableError):
        return "no colour image can be decoded"
    if isinstance(error, ChannelError):
        role = error.role or "a role"
        return f"no clear choice for {role}" if error.rivals else f"no channel for {role}"
    return "the class table" if isinstance(error, ClassTableError) else "see the message"


def _joined(sections: Iterable[str]) -> str:
    lines = "\n\n".join(section for section in sections if section).split("\n")
    return "\n".join(plain(line, MAX_SENTENCE).rstrip() for line in lines) + "\n"


def _wrapped(label: str, texts: Iterable[str], width: int, indent: int = 0) -> Iterator[str]:
    """Paragraphs behind `label`, in lines of `width`, with a hanging indent."""
    for text in texts:
        indent = indent or len(label)
        yield from wrap(
            label + plain(text, MAX_SENTENCE), width, subsequent_indent=" " * indent, break_on_hyphens=False
        )  # fmt: skip


def _head(found: Inspection, width: int) -> str:
    log = found.log
    lines = [
        f"{plain(log.name)}: {log.size_bytes / 1e6:.1f} MB, {log.duration_s:.1f} s, profile "
        f"{plain(log.profile) or 'none'}, written by {plain(log.library) or 'unknown'}",
        f"sha256 {log.sha256}",
    ]
    if len(log.files) > 1:
        lines += _wrapped("files  ", [f"{len(log.files)}: {', '.join(map(plain, log.files))}"], width)
    return "\n".join(lines)


def _used(found: Inspection) -> str:
    rows = [
        [role, plain(topic) if topic else "nothing", found.reasons.get(role, "no such channel that can be used")]
        for role, topic in found.used.items()
    ]
    return tabulate(rows, ["for", "would be used", "because"], disable_numparse=True)


def _facts(found: Inspection, width: int) -> str:
    facts = {
        "Frames": _frames(found), "Camera": _camera(found), "Depth": _depth(found), "Pose": _pose(found),
        "Clocks": _clocks(found),
    }  # fmt: skip
    lines = [line for name, text in facts.items() for line in _wrapped(f"{name}:".ljust(9), [text], width)]
    return "\n".join([*lines, *(line for text in found.notes for line in _wrapped("Note:    ", [text], width))])


def _frames(found: Inspection) -> str:
    f = found.frames
    partners = (("depth", f.with_depth), ("a pose", f.with_pose), ("truth", f.with_truth))
    with_ = ", ".join(f"with {what} {n} ({n / f.count:.0%})" for what, n in partners)
    undecodable = f"; {f.undecodable} of {f.looked_at} looked at cannot be decoded" if f.undecodable else ""
    return f"{f.count} of {f.width}x{f.height} every {f.period_ms:.1f} ms; {with_}{undecodable}"


def _camera(found: Inspection) -> str:
    c = found.camera
    if c is None:
        return "no intrinsics"
    numbers = f"fx {c.fx:.6g} fy {c.fy:.6g} cx {c.cx:.6g} cy {c.cy:.6g} px"
    return f"{numbers}; sees {c.across_deg:.1f} x {c.down_deg:.1f} degrees; lens distortion: {c.distortion}"


def _depth(found: Inspection) -> str:
    depth = found.depth
    if depth is None:
        return "none"
    marks = ", ".join(f"{p} % {metres:.2f} m" for p, metres in depth.percentiles_m.items()) or "no known pixel"
    unknown = number(depth.unknown_share, "{:.1%}")
    looked_at = f"{unknown} unknown in {depth.frames} frames looked at"
    return f"{plain(depth.content)}; pixels are {depth.pixels}; {marks}; {looked_at}"


def _pose(found: Inspection) -> str:
    pose = found.pose
    if pose is None:
        return "none"
    chain = " -> ".join(plain(frame) or "unnamed" for frame in pose.frames)
    return (
        f"{chain}; {pose.samples} samples, path of {pose.path_m:.2f} m, largest gap {pose.largest_gap_s * 1000:.0f} ms"
    )


def _clocks(found: Inspection) -> str:
    offsets = [f"{ns / 1e6:+.1f} ms taken out of {plain(topic)}" for topic, ns in found.clock_offsets_ns.items()]
    color = next((c for c in found.channels if c.role == "color"), None)
    if color is not None and color.offset_min_ns is not None and not offsets:
        return f"color is logged {color.offset_min_ns / 1e6:.1f} ms behind its stamp or later; nothing taken out"
    return ", ".join(offsets) or NONE


def _truth(found: Inspection) -> str:
    if found.truth is None:
        return "Truth:   none"
    rows = [[row.id, plain(row.name), row.pixels, number(row.share, "{:.2%}")] for row in found.truth.classes]
    ignored = number(found.truth.ignored_share, "{:.2%}")
    return (
        f"Truth:   {len(rows)} classes in {found.truth.frames} frames looked at; {ignored} of the pixels ignored\n"
        + tabulate(rows, ["id", "class", "pixels", "share of labelled"], disable_numparse=True,
                   colalign=("right", "left", "right", "right"))
    )  # fmt: skip


def _findings(found: Inspection, width: int) -> str:
    lines: list[str] = []
    for k, finding in enumerate(found.findings, 1):
        label = f"{k:2}. "
        lines += _wrapped(label, [f"{finding.name}: {finding.what}"], width)
        lines += _wrapped(f"{' ' * len(label)}do: ", [finding.do], width)
    return "\n".join(lines)


def _verdict(found: Inspection, command: str) -> str:
    n = len(found.findings)
    return f"{f'Usable with {n} finding' + 's' * (n > 1) if n else 'Ready'}: {command}"
