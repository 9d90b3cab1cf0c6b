"""The paper's three tables again, at a small scale: `python -m bench.paper table1|table2|table3`."""
