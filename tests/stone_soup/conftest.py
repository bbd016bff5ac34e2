"""Makes the helpers of the wiring tests importable by name."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "wiring"))
