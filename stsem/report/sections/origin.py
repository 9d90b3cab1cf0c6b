"""Sections about what was replayed, by what, and how to do it again."""

import json

from stsem.document.schema import Document
from stsem.report.outline import Block, Code, Column, Folded, Items, Row, Section, Table, Text
from stsem.report.wording import NONE, count, number


def input_section(document: Document) -> Section:
    """The logs, their channels and their damage."""
    blocks: list[Block] = [_logs(document), _channels(document)]
    damage = tuple(f"{log.name}: {kind.replace('_', ' ')}: {json.dumps(what)}" for log in document.input.logs
                   for kind, what in log.damage.items())  # fmt: skip
    blocks.append(Items(damage, warning=True) if damage else Text("No damage was found in the log."))
    return Section("Input", tuple(blocks))


def _logs(document: Document) -> Table:
    columns = (Column("log", number=False), Column("frames"), Column("with truth"), Column("seconds"),
               Column("period, ms"), Column("colour"), Column("scored at"), Column("sha256", number=False))  # fmt: skip
    rows = tuple(
        Row((log.name, count(log.frames), count(log.frames_with_truth), number(log.duration_s), number(log.period_ms),
             _size(log.size), _size(log.truth_size), f"`{log.sha256[:16]}`"))
        for log in document.input.logs
    )  # fmt: skip
    return Table(columns, rows)


def _channels(document: Document) -> Table:
    columns = (Column("used as", number=False), Column("topic", number=False), Column("messages"),
               Column("schema", number=False), Column("clock offset, ms", "smallest log time - stamp"))  # fmt: skip
    rows = tuple(
        Row((role, f"`{channel.topic}`", count(channel.messages), channel.schema_name,
             number(channel.offset_ms) + (" (taken out)" if channel.offset_removed else "")))
        for log in document.input.logs
        for role, channel in log.channels.items()
    )  # fmt: skip
    return Table(columns, rows)


def _size(size: tuple[int, int] | None) -> str:
    return NONE if size is None else f"{size[0]}×{size[1]}"


def unmeasured_section(document: Document) -> Section | None:
    """Everything that was not measured, and why."""
    modes: dict[tuple[str, str], list[str]] = {}
    for run in document.runs:
        for part, why in run.not_measured.items():
            modes.setdefault((part.replace("_", " ").replace(".", ": "), why), []).append(run.mode)
    parts: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for (part, why), named in modes.items():
        parts.setdefault((why, tuple(named)), []).append(part)
    items = tuple(
        f"{', '.join(names)}: {why}" + (f" ({', '.join(named)})" if len(named) < len(document.runs) else "")
        for (why, named), names in parts.items()
    )
    return Section("Not measured", (Items(items),)) if items else None


def identity_section(document: Document) -> Section:
    """Network, backend, versions, costs, configuration: what makes the bytes."""
    who = document.identity
    facts = {
        "network": who.model, "inputs of the network": ", ".join(who.model_inputs),
        "network sha256": who.model_sha256, "sidecar sha256": who.sidecar_sha256,
        "backend": who.backend, "precision": who.precision, "CPU features": " ".join(who.cpu_features),
        "costs": who.costs + (" (disturbed: measured while other work held a core)" if who.costs_disturbed else ""),
        "costs sha256": who.costs_sha256, "configuration hash": document.config_hash, "digest": document.digest,
    }  # fmt: skip
    rows = [Row((name, f"`{value}`" if "sha256" in name or name in ("digest", "configuration hash") else str(value)))
            for name, value in facts.items() if value]  # fmt: skip
    rows.append(Row(("versions", ", ".join(f"{name} {version}" for name, version in sorted(who.versions.items())))))
    table = Table((Column("identity", number=False), Column("", number=False)), tuple(rows))
    config = Code(json.dumps(document.config, indent=2, sort_keys=True, ensure_ascii=False))
    return Section("Installation and configuration", (table, Folded("Resolved configuration", (config,))))


def reproduce_section(document: Document) -> Section:
    """One command, and what the host did meanwhile."""
    host = document.host
    blocks: list[Block] = [Code(host.command or "the command was not recorded")]
    same = "The same log, configuration, costs and installation give the same digest again"
    blocks.append(Text(f"{same}, `{document.digest}`; `--repeat 2` checks it."))
    memory = NONE if host.peak_memory_bytes is None else count(host.peak_memory_bytes >> 20)
    facts = {
        **host.machine, "started": host.started_at, "wall-clock, s": _maybe(host.wall_s),
        "CPU time, s": _maybe(host.cpu_s), "harness overhead, ms per frame": _maybe(host.overhead_ms),
        "peak memory, MiB": memory,
    }  # fmt: skip
    rows = [Row((name, value)) for name, value in facts.items() if value and value != NONE]
    rows += [
        Row((f"{stage}, wall-clock mean / max, ms", f"{_maybe(cost.mean_ms)} / {_maybe(cost.max_ms)} (n = {cost.n})"))
        for stage, cost in host.stages.items()
    ]
    table = Table((Column("host", number=False), Column("", number=False)), tuple(rows),
                  ("Outside the digest, never gated: what this host did while the report was made.",))  # fmt: skip
    return Section("Reproduce", (*blocks, Folded("This host", (table,))))


def _maybe(value: float | None) -> str:
    return NONE if value is None else number(value)
