"""`stsem gate`: a report against a baseline, a verdict, an exit code."""

from pathlib import Path
from typing import Annotated

import typer

from stsem.cli.launch import verb

HELP = """Gate a report against a baseline: exit code 0 passed, 4 failed, 5 not comparable or nothing measured.

    stsem gate reports/office/ab12cd34-5678ef90 --baseline baselines/office.json
    stsem gate REPORT --baseline FILE --limit offline.miou=1.0 --no-timing
    stsem gate REPORT --write-baseline baselines/office.json
"""


@verb
def gate(
    report: Annotated[Path, typer.Argument(metavar="REPORT", help="report.json, or the folder that holds it.")],
    baseline: Annotated[Path | None, typer.Option("--baseline", help="Reviewed baseline, or another report.")] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option("--limit", metavar="METRIC=X", help="Allowed worsening: points of a score, per cent of a time."),
    ] = None,
    timing: Annotated[bool, typer.Option("--timing/--no-timing", help="Gate latency and rate, too.")] = True,
    exact: Annotated[
        bool | None, typer.Option("--exact/--no-exact", help=r"Same results to the byte. \[oracle runs]")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Write the Markdown verdict here.")] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print the verdict as JSON instead of Markdown.")] = False,
    write_baseline: Annotated[
        Path | None,
        typer.Option("--write-baseline", metavar="FILE", help="Make REPORT the new baseline, judge nothing."),
    ] = None,
) -> int:
    """Judge, or write a baseline."""
    from stsem.document.canonical import canonical, read_document
    from stsem.errors import UsageError
    from stsem.gate.baseline import baseline_bytes, make_baseline, read_baseline
    from stsem.gate.judge import gate as judge
    from stsem.gate.markdown import gate_markdown
    from stsem.gate.rules import Limits

    document = read_document(report)
    if write_baseline is not None:
        _write(write_baseline, baseline_bytes(make_baseline(document)))
        return 0
    if baseline is None:
        raise UsageError("The gate needs a --baseline to judge against, or --write-baseline to make one.")
    limits = Limits(timing=timing, exact=exact).with_limits(_numbers(limit or []))
    verdict = judge(document, read_baseline(baseline), limits)
    text = gate_markdown(verdict, f"stsem gate {report} --baseline {baseline}")
    if out is not None:
        _write(out, text.encode())
    print(canonical(verdict.model_dump(mode="json")).decode() if json_ else text, end="")
    return verdict.exit_code


def _numbers(texts: list[str]) -> dict[str, float]:
    from stsem.errors import UsageError

    table = {}
    for text in texts:
        metric, _, number = text.partition("=")
        try:
            table[metric] = float(number)
        except ValueError:
            raise UsageError(f"--limit takes METRIC=NUMBER, such as offline.miou=0.5, but {text!r} came.") from None
    return table


def _write(path: Path, data: bytes) -> None:
    from stsem.errors import OutputError

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except OSError as err:
        raise OutputError(f"{path} cannot be written ({err.strerror}); choose another place.") from err
