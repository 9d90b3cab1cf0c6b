"""The facts of an opened log: names, channels, what is used as what."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stsem.log.assemble import Assembly
from stsem.log.candidate import Candidate
from stsem.log.container.files import Given, natural
from stsem.log.container.source import is_url, local_path, shown_name
from stsem.log.info import ChannelInfo, Choice, LogInfo
from stsem.log.poses.tree import is_static
from stsem.log.scan import Scan
from stsem.log.schemas.messages import Kind
from stsem.log.tracks import Track
from stsem.plain import MAX_NAME, plain


def describe(paths: Sequence[Given], scan: Scan, assembly: Assembly) -> LogInfo:
    """Everything that can be said without decoding more images."""
    stamps = assembly.color.rows.stamp_ns
    return LogInfo(
        name=log_name(paths),
        sources=tuple(file.source for file in scan.files),
        sha256=scan.sha256,
        size_bytes=sum(file.size for file in scan.files),
        duration_s=int(stamps[-1] - stamps[0]) / 1e9,
        channels=channel_infos(scan, assembly),
        choice=_choice(assembly),
        reasons=_reasons(assembly, scan),
        pose_frames=assembly.poses.frames if assembly.poses else (),
        damage=scan.damage,
        unprotected=scan.unprotected,
        warnings=tuple(assembly.warnings),
        clock_offsets_ns=dict(assembly.clock_offsets_ns),
        library=scan.library,
        profile=scan.profile,
    )


def channel_infos(scan: Scan, assembly: Assembly | None = None) -> tuple[ChannelInfo, ...]:
    """Every channel, in order of topic; what it is used as and what its images hold only with an `assembly`."""
    tracks = sorted(scan.tracks.values(), key=lambda track: (track.topic, track.encoding, track.schema))
    roles = _roles(assembly, tracks) if assembly else {}
    images = {id(image.track): image for image in assembly.images} if assembly else {}
    return tuple(_channel(track, roles.get(id(track), ""), images.get(id(track))) for track in tracks)


def log_name(paths: Sequence[Given]) -> str:
    """Name of the only file or folder; of several files, of the first in order of their names.

    It becomes the name of a folder, so it holds no separators, nothing that does not print, and never means a parent.
    """
    first = min(paths, key=lambda given: natural(shown_name(given)))
    name = shown_name(first) if is_url(first) else _local_name(local_path(first))
    kept = re.sub(r'[/\\:*?"<>|]', "_", plain(name.removesuffix(".mcap").removesuffix(".MCAP")))
    while len(kept.encode()) > MAX_NAME:
        kept = kept[:-1]
    return kept if kept.strip(". ") else "log"


def _local_name(path: Path) -> str:
    resolved = path.resolve()
    return resolved.name if resolved.is_dir() else path.name


def _choice(assembly: Assembly) -> Choice:
    return Choice(
        color=assembly.color.topic,
        depth=assembly.depth.topic if assembly.depth else None,
        pose=assembly.pose_topic,
        labels=assembly.labels.topic if assembly.labels else None,
        calibration=assembly.optics.track.topic if assembly.optics.track else None,
    )


def _roles(assembly: Assembly, tracks: Sequence[Track]) -> dict[int, str]:
    """id of track -> what it is used as; tracks that are not used are absent."""
    channels = {"color": assembly.color, "depth": assembly.depth, "labels": assembly.labels}
    found = {id(channel.track): role for role, channel in channels.items() if channel}
    if assembly.optics.track:
        found[id(assembly.optics.track)] = "calibration"
    for track in tracks:
        if assembly.poses and not assembly.poses.by_chain and track.topic == assembly.poses.topic:
            found[id(track)] = "pose"
        elif assembly.poses and assembly.poses.by_chain and track.kind is Kind.TRANSFORMS:
            found[id(track)] = "tf_static" if is_static(track) else "tf"
        elif track.kind is Kind.CLASS_TABLE and assembly.table:
            found[id(track)] = "classes"
    return found


def _reasons(assembly: Assembly, scan: Scan) -> dict[str, str]:
    """Role -> why this channel: the rules of `choose` in a few words."""
    rivals = Counter(image.nature for image in assembly.images)
    poses = sum(track.kind is Kind.POSE and track.count > 0 for track in scan.tracks.values())
    reasons = {
        "color": assembly.why_color,
        "depth": "only one" if rivals["depth"] == 1 else "nearest to color",
        "labels": "only one" if rivals["labels"] == 1 else "nearest to color",
        "pose": "only one" if poses == 1 else "by its name",
        "calibration": "belongs to color",
    }
    if assembly.poses and assembly.poses.by_chain:
        reasons["pose"] = "chain of transforms"
    reasons |= dict.fromkeys(assembly.asked, "asked for")
    return {role: why for role, why in reasons.items() if getattr(_choice(assembly), role) is not None}


def _channel(track: Track, role: str, image: Candidate | None) -> ChannelInfo:
    offsets = track.stamp_offsets_ns()
    first, last = track.first_log_ns, track.last_log_ns
    span = 0 if first is None or last is None else last - first
    return ChannelInfo(
        topic=track.topic,
        schema=track.schema,
        encoding=track.encoding,
        count=track.count,
        rate_hz=(track.count - 1) / (span / 1e9) if span else None,
        first_log_ns=first,
        last_log_ns=last,
        offset_min_ns=int(offsets.min()) if len(offsets) else None,
        offset_median_ns=int(np.median(offsets)) if len(offsets) else None,
        offset_max_ns=int(offsets.max()) if len(offsets) else None,
        unstamped=track.unstamped,
        largest_gap_s=track.largest_gap_ns / 1e9 if track.count > 1 else None,
        content=plain(image.look.name) if image else "",
        nature=image.nature if image else "",
        role=role,
    )
