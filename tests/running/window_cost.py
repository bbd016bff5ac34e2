"""What a window costs whatever is in it: ``python tests/running/window_cost.py``.

Two blocks send each other one row in every window. Printed is the least CPU of some runs by their
windows: the blocks' own work, with nothing recorded.
"""

import gc
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

SCENE = """
seed = 1
duration_s = {duration_s}
wires = [
  "pulse -> cued.in",
  "cued -> relay",
  {{ from = "relay", to = "cued.cue", delay_s = 0.1, holds = "nothing" }},
]
[blocks.pulse]
type = "engine_blocks:Pulse"
scan_rate_hz = 10
[blocks.cued]
type = "engine_blocks:Cued"
scan_rate_hz = 10
[blocks.relay]
type = "engine_blocks:Relay"
"""


class Counted(Simulation):
    """A run that counts its windows."""

    windows_run = 0

    def run_window(self, window):
        self.windows_run += 1
        return super().run_window(window)


def window_cost_s(duration_s: float, repeats: int) -> tuple[int, float]:
    """Return how many windows a run has, and what each costs, s of CPU."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place, "scene.toml")
        path.write_text(SCENE.format(duration_s=duration_s), encoding="utf-8")
        scene = load_scene(path)
    spent = []
    for _ in range(repeats):
        simulation = Counted(scene)
        gc.collect()
        started = time.process_time()
        simulation.run()
        spent.append(time.process_time() - started)
    return simulation.windows_run, min(spent) / simulation.windows_run


if __name__ == "__main__":
    count, cost_s = window_cost_s(200.0, 7)
    print(f"{count} windows, {1e6 * cost_s:.0f} µs each")
