"""Path of the independent judge: bench/honesty, which shares nothing with the product or with other tests."""

import os
import sys
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
HONESTY = SOURCE / "bench/honesty"
sys.path.insert(0, str(HONESTY))
os.environ.setdefault("VGYRO_BIN", str(SOURCE / "build/release/bin"))
