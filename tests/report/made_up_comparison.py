"""The made-up comparison of the two modes."""

from made_up_schedule import FRAMES

from stsem.document.schema import Comparison, ComparisonRow, Document, Run


def comparison(runs: tuple[Run, ...], truth: bool, clock: bool) -> Comparison:
    base, other = runs
    rows = []
    for name in ("offline", "delivered", "streaming"):
        for key in ("miou", "pixel_accuracy"):
            a, b = getattr(base, name), getattr(other, name)
            if a and b:
                delta = getattr(b, key) - getattr(a, key)
                rows.append(
                    ComparisonRow(
                        metric=f"{name.replace('delivered', 'delivered_paired')}.{key}",
                        base=getattr(a, key),
                        other=getattr(b, key),
                        delta=delta,
                        ci95=(delta - 0.012, delta + 0.015),
                        n=FRAMES,
                        unit="fraction",
                    )
                )
    if clock and base.latency_ms and other.latency_ms and base.throughput and other.throughput:
        for key in ("mean", "p50", "max"):
            x, y = getattr(base.latency_ms.from_arrival, key), getattr(other.latency_ms.from_arrival, key)
            rows.append(
                ComparisonRow(
                    metric=f"latency_ms.from_arrival.{key}",
                    base=x,
                    other=y,
                    delta=y - x,
                    n=FRAMES,
                    unit="ms",
                    higher_is_better=False,
                    ci95=(y - x - 9, y - x + 7) if key == "mean" else None,
                    why_no_interval="" if key == "mean" else "no interval is computed for it",
                )
            )
        hz = base.throughput.output_hz or 0.0, other.throughput.output_hz or 0.0
        rows.append(
            ComparisonRow(
                metric="throughput.output_hz",
                base=hz[0],
                other=hz[1],
                delta=hz[1] - hz[0],
                n=FRAMES,
                unit="Hz",
                why_no_interval="a rate of the whole run",
            )
        )
    return Comparison(base=base.mode, other=other.mode, rows=tuple(rows))


def with_third_mode(document: Document) -> Document:
    """The same report with `keyframe-async`, which is like `keyframe` but half a frame per second faster."""
    base, other = document.runs
    assert other.throughput is not None
    rate = (other.throughput.output_hz or 0.0) + 0.5
    faster = other.throughput.model_copy(update={"output_hz": rate})
    third = other.model_copy(update={"mode": "keyframe-async", "throughput": faster})
    more = (comparison((base, third), truth=True, clock=True),)
    return document.model_copy(update={"runs": (base, other, third), "more_comparisons": more})
