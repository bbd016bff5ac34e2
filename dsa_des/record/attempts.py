"""Attempts that may fail without spoiling what is done: a summary, a figure of a run."""

from collections.abc import Callable
from typing import Any


def attempt(
    what: str,
    notes: list[str],
    call: Callable[..., Any],
    *arguments: Any,
    unless: type[Exception] = BrokenPipeError,
) -> Any:
    """Return what a call gives; if it raises, add a note that says so and return None.

    Parameters
    ----------
    what : str
        What the call makes, for the note.
    notes : list of str
        Takes the note.
    call : callable
    *arguments
        Of the call.
    unless : type of exception
        What is raised all the same; by default, that the reader of our output went away.
    """
    try:
        return call(*arguments)
    except unless:
        raise
    except Exception as error:  # MemoryError is one of them
        notes.append(f"{what} failed: {_reason(error)}")
        return None


def _reason(error: Exception) -> str:
    text = str(error).strip().split("\n")[0]
    if isinstance(error, MemoryError):
        return f"out of memory{': ' if text else ''}{text}"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
