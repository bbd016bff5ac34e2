"""Warnings before a run: of blocks about their own values, and of a run that will take long."""

from dsa_des.record.sinks import attempt
from dsa_des.running.simulation import Simulation
from dsa_des.terminal.terminal import say
from dsa_des.text.safe_text import shortened

MOST_WARNINGS = 20
_LONGEST = 500


def warnings_of(simulation: Simulation) -> list[str]:
    """Return what the blocks of a scene that is set up warn of, each with its block's name.

    Keys that change nothing come before what a block itself has to say.
    """
    found: list[str] = []
    for name, section in simulation.scene.sections.items():
        found += [f"{name}: {text}" for text in section.without_effect()]
    for name, component in simulation.components.items():
        found += [f"blocks.{name}: {text}" for text in component.p.without_effect()]
        for text in attempt(f"blocks.{name}: warnings", found, component.warnings) or ():
            found.append(f"blocks.{name}: {shortened(str(text), _LONGEST)}")
    return found


def say_warnings(warnings: list[str], word: str) -> None:
    """Print warnings on standard error, after a word such as ``note``."""
    for text in warnings[:MOST_WARNINGS]:
        say(f"{word}: {text}", err=True)
    if len(warnings) > MOST_WARNINGS:
        say(f"{word}: and {len(warnings) - MOST_WARNINGS} more", err=True)


# Half a minute of the processor, for most scenes.
_MANY_SCANS = 1e7


def say_if_long(simulation: Simulation) -> None:
    """Say on standard error that a run will take long, before it does."""
    if simulation.scans > _MANY_SCANS:
        message = f"note: {float(simulation.duration_s):.4g} s of this scene are about "
        say(f"{message}{simulation.scans:.2g} scans", err=True)
