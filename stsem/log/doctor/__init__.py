"""What is in a log, what would be used of it, what looks wrong with it, and what to do about that."""
