"""The report as data: its schema, its canonical bytes, its digest, and where two reports differ."""
