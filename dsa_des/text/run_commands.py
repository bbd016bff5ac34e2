"""The command that runs a scene with a seed, swaps and values."""

import shlex
from collections.abc import Iterable
from fractions import Fraction
from typing import Any


def shell_command_of_run(
    scene: str,
    seed: int,
    swaps: Iterable[tuple[str, str]],
    sets: Iterable[tuple[str, str]],
) -> str:
    """Return the shell command ``dsa-des run`` for a scene with a seed, swaps and set values."""
    words = ["dsa-des", "run", scene, "--seed", str(seed)]
    for block, name in swaps:
        words += ["--swap", f"{block}={name}"]
    for key, value in sets:
        words += ["--set", f"{key}={value}"]
    return shlex.join(words)


def format_set_option_value(value: Any) -> str:
    """Return a value as text in the form that ``--set`` takes."""
    if isinstance(value, Fraction):
        decimal = f"{float(value):.9f}".rstrip("0").rstrip(".")
        return decimal if Fraction(decimal) == value else f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
