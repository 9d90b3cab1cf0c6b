"""Makes the modules of this folder, and the encoders of tests/log, importable by its tests."""

import sys
from pathlib import Path

for folder in (".", "../log"):
    sys.path.insert(0, str((Path(__file__).parent / folder).resolve()))
