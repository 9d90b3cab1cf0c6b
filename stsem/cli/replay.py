"""`stsem replay`, also `stsem-replay`: a log in, a report out."""

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from stsem.cli.launch import verb

HELP = """Replay recorded logs through the pipeline and report accuracy, latency and throughput.

    stsem-replay log.mcap
    stsem-replay log.mcap --mode keyframe --keyframes every:5
    stsem-replay log.mcap --model my-network.onnx --costs robot.json
    stsem-replay log.mcap --model oracle --clock offline --json
"""

_INPUT, _PIPELINE, _CLOCK, _OUTPUT = "Input", "Pipeline", "Clock", "Output"


def _option(*names: str, panel: str, help: str, metavar: str | None = None) -> Any:
    return typer.Option(*names, help=help, rich_help_panel=panel, metavar=metavar, show_default=False)


@verb
def replay(
    logs: Annotated[
        list[str], typer.Argument(metavar="LOG...", help="MCAP files, folders of one recording, https:// or s3://.")
    ],
    mode: Annotated[
        str | None, _option("--mode", panel=_PIPELINE, metavar="MODE,...", help="per-frame, keyframe, both. [both]")
    ] = None,
    model: Annotated[
        str | None,
        _option("--model", panel=_PIPELINE, metavar="NAME|ONNX|oracle", help="Network, or the truth as one. [default]"),
    ] = None,
    backend: Annotated[
        str | None,
        _option("--backend", panel=_PIPELINE, help="What runs the network: onnxruntime or openvino. [onnxruntime]"),
    ] = None,
    precision: Annotated[
        str | None, _option("--precision", panel=_PIPELINE, help="f32, int8 or (openvino only) bf16. [f32]")
    ] = None,
    keyframes: Annotated[
        str | None, _option("--keyframes", panel=_PIPELINE, metavar="POLICY", help="paper or every:N. [paper]")
    ] = None,
    propagation: Annotated[
        str | None, _option("--propagation", panel=_PIPELINE, metavar="METHOD", help="hold or homography. [homography]")
    ] = None,
    pose: Annotated[str | None, _option("--pose", panel=_PIPELINE, help="Where poses come from: log. [log]")] = None,
    map_: Annotated[str | None, _option("--map", panel=_PIPELINE, metavar="on|off", help="Labelled map. [on]")] = None,
    depth_registered: Annotated[
        str | None,
        _option("--depth-registered", panel=_INPUT, metavar="yes|no|auto", help="Depth matches colour. [auto]"),
    ] = None,
    topic: Annotated[
        list[str] | None,
        _option("--topic", panel=_INPUT, metavar="ROLE=TOPIC", help="Channel for color, depth, pose or labels."),
    ] = None,
    classes: Annotated[Path | None, _option("--classes", panel=_INPUT, help="Class table of the truth.")] = None,
    class_map: Annotated[
        Path | None, _option("--class-map", panel=_INPUT, help="TOML of network class = log class.")
    ] = None,
    start: Annotated[float | None, _option("--start", panel=_INPUT, metavar="S", help="Window, seconds.")] = None,
    end: Annotated[
        float | None, _option("--end", panel=_INPUT, metavar="S", help="Window, seconds, exclusive.")
    ] = None,
    clock: Annotated[
        str | None, _option("--clock", panel=_CLOCK, help="real-time (simulated) or offline. [real-time]")
    ] = None,
    rate: Annotated[str | None, _option("--rate", panel=_CLOCK, metavar="R", help="Replay speed. [1]")] = None,
    queue: Annotated[
        str | None, _option("--queue", panel=_CLOCK, metavar="RULE", help="latest, fifo:N or lossless. [latest]")
    ] = None,
    cores: Annotated[int | None, _option("--cores", panel=_CLOCK, metavar="N", help="Simulated cores. [2]")] = None,
    deadline_ms: Annotated[
        float | None, _option("--deadline-ms", panel=_CLOCK, metavar="MS", help="From arrival. [capture period]")
    ] = None,
    costs: Annotated[
        str | None, _option("--costs", panel=_CLOCK, metavar="auto|measured|FILE", help="Durations of jobs. [auto]")
    ] = None,
    seed: Annotated[int | None, _option("--seed", panel=_CLOCK, metavar="N", help="Of every draw. [0]")] = None,
    count_decode: Annotated[
        bool, _option("--count-decode", panel=_CLOCK, help="Charge decoding to the simulated cores.")
    ] = False,
    no_offline: Annotated[bool, _option("--no-offline", panel=_CLOCK, help="Skip the pass without a clock.")] = False,
    sustainable: Annotated[
        bool, _option("--sustainable", panel=_CLOCK, help="Search for the highest sustainable rate.")
    ] = False,
    out: Annotated[Path | None, _option("--out", panel=_OUTPUT, metavar="DIR", help="Report folder.")] = None,
    config: Annotated[
        Path | None, _option("--config", panel=_OUTPUT, metavar="TOML", help="Configuration. [stsem.toml]")
    ] = None,
    set_: Annotated[
        list[str] | None, _option("--set", panel=_OUTPUT, metavar="KEY=VALUE", help="Any configuration key.")
    ] = None,
    annotate: Annotated[bool, _option("--annotate", panel=_OUTPUT, help="Also write annotated.mcap.")] = False,
    no_plots: Annotated[bool, _option("--no-plots", panel=_OUTPUT, help="Draw nothing.")] = False,
    no_cache: Annotated[bool, _option("--no-cache", panel=_OUTPUT, help="Keep and reuse nothing.")] = False,
    repeat: Annotated[
        int | None, _option("--repeat", panel=_OUTPUT, metavar="N", help="Replay N times; fail on any difference.")
    ] = None,
    json_: Annotated[bool, _option("--json", panel=_OUTPUT, help="Print report.json instead of the table.")] = False,
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
