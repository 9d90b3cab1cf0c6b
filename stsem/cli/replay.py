"""`stsem replay`, also `stsem-replay`: a log in, a report out."""

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from stsem.cli.launch import verb
from stsem.cli.options import option

HELP = """Replay recorded logs through the pipeline and report accuracy, latency and throughput.

    stsem-replay log.mcap
    stsem-replay log.mcap --mode keyframe --keyframes every:5
    stsem-replay log.mcap --model my-network.onnx --costs robot.json
    stsem-replay log.mcap --model oracle --clock offline --json
"""

_INPUT, _PIPELINE, _CLOCK, _OUTPUT = "Input", "Pipeline", "Clock", "Output"


@verb
def replay(
    logs: Annotated[
        list[str], typer.Argument(metavar="LOG...", help="MCAP files, folders of one recording, https:// or s3://.")
    ],
    mode: Annotated[
        str | None,
        option("--mode", panel=_PIPELINE, metavar="MODE,...", help="per-frame, keyframe, keyframe-async, both. [both]"),
    ] = None,
    model: Annotated[
        str | None,
        option("--model", panel=_PIPELINE, metavar="NAME|ONNX|oracle", help="Network, or the truth as one. [default]"),
    ] = None,
    backend: Annotated[
        str | None,
        option("--backend", panel=_PIPELINE, help="What runs the network: onnxruntime or openvino. [onnxruntime]"),
    ] = None,
    precision: Annotated[
        str | None, option("--precision", panel=_PIPELINE, help="f32, int8 or (openvino only) bf16. [f32]")
    ] = None,
    keyframes: Annotated[
        str | None,
        option(
            "--keyframes",
            panel=_PIPELINE,
            metavar="POLICY",
            help="paper, every:N, coverage:SHARE, budget:HZ. [paper]",
        ),
    ] = None,
    propagation: Annotated[
        str | None,
        option(
            "--propagation",
            panel=_PIPELINE,
            metavar="METHOD",
            help="auto, hold, homography, homography-chained, flow, depth. [auto]",
        ),
    ] = None,
    pose: Annotated[
        str | None, option("--pose", panel=_PIPELINE, metavar="log|slam", help="Where poses come from. [log]")
    ] = None,
    map_: Annotated[str | None, option("--map", panel=_PIPELINE, metavar="on|off", help="Labelled map. [on]")] = None,
    depth_registered: Annotated[
        str | None,
        option("--depth-registered", panel=_INPUT, metavar="yes|no|auto", help="Depth matches colour. [auto]"),
    ] = None,
    topic: Annotated[
        list[str] | None,
        option("--topic", panel=_INPUT, metavar="ROLE=TOPIC", help="Channel for color, depth, pose or labels."),
    ] = None,
    classes: Annotated[Path | None, option("--classes", panel=_INPUT, help="Class table of the truth.")] = None,
    class_map: Annotated[
        Path | None, option("--class-map", panel=_INPUT, help="TOML of network class = log class.")
    ] = None,
    start: Annotated[float | None, option("--start", panel=_INPUT, metavar="S", help="Window, seconds.")] = None,
    end: Annotated[float | None, option("--end", panel=_INPUT, metavar="S", help="Window, seconds, exclusive.")] = None,
    clock: Annotated[
        str | None, option("--clock", panel=_CLOCK, help="real-time (simulated) or offline. [real-time]")
    ] = None,
    rate: Annotated[str | None, option("--rate", panel=_CLOCK, metavar="R", help="Replay speed. [1]")] = None,
    queue: Annotated[
        str | None, option("--queue", panel=_CLOCK, metavar="RULE", help="latest, fifo:N or lossless. [latest]")
    ] = None,
    cores: Annotated[int | None, option("--cores", panel=_CLOCK, metavar="N", help="Simulated cores. [2]")] = None,
    deadline_ms: Annotated[
        float | None, option("--deadline-ms", panel=_CLOCK, metavar="MS", help="From arrival. [capture period]")
    ] = None,
    costs: Annotated[
        str | None, option("--costs", panel=_CLOCK, metavar="auto|measured|FILE", help="Durations of jobs. [auto]")
    ] = None,
    seed: Annotated[int | None, option("--seed", panel=_CLOCK, metavar="N", help="Of every draw. [0]")] = None,
    count_decode: Annotated[
        bool, option("--count-decode", panel=_CLOCK, help="Charge decoding to the simulated cores.")
    ] = False,
    no_offline: Annotated[bool, option("--no-offline", panel=_CLOCK, help="Skip the pass without a clock.")] = False,
    sustainable: Annotated[
        bool, option("--sustainable", panel=_CLOCK, help="Search for the highest sustainable rate.")
    ] = False,
    out: Annotated[Path | None, option("--out", panel=_OUTPUT, metavar="DIR", help="Report folder.")] = None,
    config: Annotated[
        Path | None, option("--config", panel=_OUTPUT, metavar="TOML", help="Configuration. [stsem.toml]")
    ] = None,
    set_: Annotated[
        list[str] | None, option("--set", panel=_OUTPUT, metavar="KEY=VALUE", help="Any configuration key.")
    ] = None,
    annotate: Annotated[bool, option("--annotate", panel=_OUTPUT, help="Also write annotated.mcap.")] = False,
    no_plots: Annotated[bool, option("--no-plots", panel=_OUTPUT, help="Draw nothing.")] = False,
    no_cache: Annotated[bool, option("--no-cache", panel=_OUTPUT, help="Keep and reuse nothing.")] = False,
    repeat: Annotated[
        int | None, option("--repeat", panel=_OUTPUT, metavar="N", help="Replay N times; fail on any difference.")
    ] = None,
    json_: Annotated[bool, option("--json", panel=_OUTPUT, help="Print report.json instead of the table.")] = False,
) -> int:
    """One report per log; the exit code is the worst of them."""
    from stsem.cli.recordings import recordings
    from stsem.cli.session import replay_all
    from stsem.replay.settings import parse_topics, resolve

    flags: dict[str, Any] = {
        "mode": mode, "model": model, "backend": backend, "precision": precision, "keyframes": keyframes,
        "propagation": propagation, "pose": pose, "map": map_, "depth_registered": depth_registered,
        "topic": parse_topics(topic or []) or None, "classes": classes, "class_map": class_map, "start": start,
        "end": end, "clock": clock, "rate": rate, "queue": queue, "cores": cores, "deadline_ms": deadline_ms,
        "costs": costs, "seed": seed, "count_decode": count_decode or None, "offline": False if no_offline else None,
        "sustainable": sustainable or None, "out": out, "annotate": annotate or None,
        "plots": False if no_plots else None, "cache": False if no_cache else None, "repeat": repeat,
        "json": json_ or None,
    }  # fmt: skip
    settings = resolve(flags, file=config, environment=os.environ, assignments=set_ or [])
    return replay_all(recordings(logs), settings)
