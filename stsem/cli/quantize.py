"""`stsem quantize`: a network in int8, calibrated on logs."""

from typing import Annotated

import typer

from stsem.cli.launch import verb

HELP = """Make the int8 variant of a network, for --precision int8 (needs the extra 'quantize').

    stsem quantize my-network.onnx --log drive-1.mcap --log drive-2.mcap   (writes my-network.int8.onnx)
    stsem-replay drive-3.mcap --model my-network.onnx --precision int8

    Ranges are taken from frames of the logs; labels play no part. Choose logs like those it will see, not those it is
    judged on.
"""
_FEW = 0.95


@verb
def quantize(
    network: Annotated[str, typer.Argument(metavar="NAME|ONNX", help="The network, in f32.")],
    logs: Annotated[
        list[str], typer.Option("--log", metavar="LOG", help="MCAP file, folder or address; repeatable.")
    ],
    frames: Annotated[int, typer.Option("--frames", min=2, max=10_000, help="Frames in all, evenly spread.")] = 24,
) -> int:  # fmt: skip
    """Write the variant beside the network and say how alike they answer."""
    from stsem.cli.console import note
    from stsem.cli.recordings import recordings
    from stsem.errors import MissingExtraError
    from stsem.inference.network import load_network
    from stsem.quantize.frames import calibration_frames

    given = load_network(network)
    try:
        from stsem.quantize.static import label_agreement
        from stsem.quantize.static import quantize as quantize_network
    except ModuleNotFoundError as err:
        raise MissingExtraError("quantize", "Quantizing a network") from err
    seen = calibration_frames(given, recordings(logs), frames)
    made = quantize_network(given, seen)
    share = label_agreement(given, made, seen)
    print(f"Variant: {made.path} ({made.path.stat().st_size / 1e6:.1f} MB), from {len(seen)} frames")
    print(f"Labels:  {share:.2%} on these frames are those of f32")
    print(f"Replay:  stsem-replay LOG --model {network} --precision int8")
    if share < _FEW:
        note("Note: the two often differ; compare their reports before you use it.")
    return 0
