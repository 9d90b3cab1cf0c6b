"""The paper's three tables again. See docs/paper-tables.md.

python -m bench.paper table1                                        # 3 seeds; the same command goes on after a stop
python -m bench.paper table1 table2 table3 --jobs 2                 # cells that tables share are trained once
python -m bench.paper table1 --data camvid=../shared/logs/camvid-0016E5-15hz.mcap
python -m bench.paper --cell sum/0                                  # one cell by itself, and what it starts from
python -m bench.paper --publish --data camvid                       # what is done into bench/paper/results and docs
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from bench.paper.data import Data, find_data
from bench.paper.plan import Cell, find_cell, with_starts
from bench.paper.tables import TABLES, cells_of
from stsem.errors import StsemError

OUT = Path(".scratch/paper")
OFFICES = Path(".scratch/paper-pairs")
say = partial(print, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; 0, or 1 with one sentence."""
    parser = _parser()
    given = parser.parse_args(arguments)
    if not (given.tables or given.cell or given.publish):
        parser.error(f"name a table ({', '.join(TABLES)}) or a --cell")
    try:
        if given.publish:
            _publish(given.data.partition("=")[0], given.out)
            return 0
        data = find_data(given.data, given.out, OFFICES)
        cells = _cells(given, data)
        if given.list:
            say("\n".join(cell.key for cell in cells))
        elif given.child:
            _child(find_cell(given.cell), data, given.out)
        else:
            _all(given, cells, data)
    except StsemError as err:
        print(err, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("Stopped; the same command goes on.", file=sys.stderr)
        return 130
    return 0


def _cells(given: argparse.Namespace, data: Data) -> list[Cell]:
    """What is to be trained, in an order in which it can be."""
    if given.cell:
        return with_starts([find_cell(given.cell)])
    wanted = [cell for table in given.tables for cell in cells_of(table, given.seeds, depth=data.depth)]
    return with_starts(sorted(wanted, key=lambda cell: cell.seed))


def _publish(data: str, out: Path) -> None:
    from bench.paper.document import publish

    say(f"{publish(out, data)} results of {data} are in the tree, and docs/paper-tables.md says what they say")


def _all(given: argparse.Namespace, cells: list[Cell], data: Data) -> None:
    """Prepare the data, run the cells that have no result, write the tables."""
    from bench.paper.cell import is_done
    from bench.paper.document import write_tables
    from bench.paper.facts import facts_of
    from bench.paper.schedule import Board, run_cells

    data.prepare(say)
    facts = facts_of(data, given.out)
    say(f"{data.name}: {facts.pairs}, problem image {facts.image}")
    missing = [cell for cell in cells if not is_done(cell, data, facts, given.out)]
    say(f"{len(missing)} of {len(cells)} cells are to be trained")
    board = Board({cell: _work(cell, data) for cell in missing}, say)
    run_cells(missing, lambda cell: child_command(cell, given.data, given.out), given.jobs, board)
    for path in write_tables(given.out, data.name, given.tables):
        say(f"\n{path}\n\n{path.read_text(encoding='utf-8')}")


def child_command(cell: Cell, data: str, out: Path) -> list[str]:
    """Arguments of the interpreter for one cell."""
    return ["-m", "bench.paper", "--child", "--cell", cell.key, "--data", data, "--out", str(out)]


def _work(cell: Cell, data: Data) -> float:
    """Processor seconds that a cell may take."""
    return cell.what.pace * data.iterations[cell.what.second] + 30.0


def _child(cell: Cell, data: Data, out: Path) -> None:
    """One cell in this process, which tells how far it is."""
    from bench.paper.cell import run_cell
    from bench.paper.facts import facts_of

    run_cell(cell, data, facts_of(data, out), out,
             lambda now: say(f"{now.iteration}/{now.iterations} loss {now.loss:.4f}"))  # fmt: skip


def _table(name: str) -> str:
    if name not in TABLES:
        raise argparse.ArgumentTypeError(f"there is no table {name!r}; choose {', '.join(TABLES)}")
    return name


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m bench.paper", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tables", nargs="*", type=_table, metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--data", default="offices", help="offices[=FOLDER], camvid=LOG.mcap or cityscapes=FOLDER")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for everything that is made")
    parser.add_argument("--seeds", type=int, default=3, help="of Tables 1 and 3")
    parser.add_argument(
        "--jobs", type=int, default=2, help="cells at a time, a thread each; results do not depend on it"
    )
    parser.add_argument("--cell", help="train this one alone, and what it starts from")
    parser.add_argument("--list", action="store_true", help="print the cells and stop")
    parser.add_argument("--publish", action="store_true", help="train nothing: results into the tree, tables into docs")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    return parser


if __name__ == "__main__":
    sys.exit(main())
