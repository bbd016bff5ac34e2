"""A run that will take long says so before it starts."""

from dsa_des.running.simulation import Simulation
from dsa_des.terminal.terminal import say

# Half a minute of the processor, for most scenes.
_MANY_SCANS = 1e7


def say_if_long(simulation: Simulation) -> None:
    """Say on standard error that a run will take long, before it does."""
    if simulation.scans > _MANY_SCANS:
        message = f"note: {float(simulation.duration_s):.4g} s of this scene are about "
        say(f"{message}{simulation.scans:.2g} scans", err=True)
