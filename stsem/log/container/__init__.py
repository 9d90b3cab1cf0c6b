"""The bytes of a recording: files, records, chunks, checksums, damage, random access to payloads."""
