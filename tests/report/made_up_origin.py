"""Where the made-up run comes from: log, installation, host."""

from made_up_pictures import CLASSES
from made_up_schedule import FRAMES

from stsem.document.origin import Channel, Host, Identity, Input, LogInput, StageCost


def identity() -> Identity:
    """A network on this backend, with a disturbed cost profile."""
    return Identity(
        backend="onnxruntime",
        precision="f32",
        versions={"stsem": "0.1.0", "onnxruntime": "1.30.0", "python": "3.11.2"},
        cpu_features=("avx2", "fma"),
        model="psp18",
        model_sha256="ab" * 32,
        sidecar_sha256="cd" * 32,
        costs="reference.json",
        costs_sha256="ef" * 32,
        costs_disturbed=True,
    )


def made_up_input(truth: bool, lossy: bool) -> Input:
    """One log, with or without truth and damage."""
    channels = {
        "color": Channel(topic="/camera/color", messages=FRAMES, schema_name="foxglove.RawImage", offset_ms=12.1),
        "pose": Channel(topic="/tf", messages=600, schema_name="foxglove.FrameTransforms", offset_ms=0.4),
        "labels": Channel(topic="/labels", messages=FRAMES, schema_name="foxglove.RawImage", offset_ms=12.1),
    }
    if not truth:
        del channels["labels"]
    log = LogInput(
        name="office.mcap",
        sha256="12" * 32,
        frames=FRAMES,
        frames_with_truth=FRAMES * truth,
        duration_s=14.9,
        period_ms=100.0,
        size=(480, 270),
        truth_size=(480, 270) if truth else None,
        channels=channels,
        damage={"crc_failures": 2, "truncated_chunks": 1} if lossy else {},
    )
    return Input(logs=(log,), classes=CLASSES if truth else (), classes_unknown_to_network=("books",) if truth else ())


def host() -> Host:
    """What differs from run to run."""
    return Host(
        paths={"log": "logs/office.mcap"},
        command="stsem-replay logs/office.mcap --costs bench/costs/reference.json",
        machine={"processor": "some CPU", "cores": "2", "memory": "8 GiB"},
        started_at="2026-01-02T03:04:05+00:00",
        wall_s=41.2,
        cpu_s=70.9,
        stages={"segment": StageCost(mean_ms=171.0, max_ms=196.0, n=150)},
        overhead_ms=4.1,
        peak_memory_bytes=512 << 20,
    )
