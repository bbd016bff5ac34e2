"""Errors and their messages."""

from dsa_des.errors.problems import (
    MOST_PROBLEMS,
    BlockFailure,
    Disagreements,
    Lines,
    OutputError,
    Problem,
    RunRefused,
    SceneError,
    SetupFailure,
    UsageError,
    did_you_mean,
    nearest_name,
    shortened_repr,
)

__all__ = [
    "MOST_PROBLEMS",
    "BlockFailure",
    "Disagreements",
    "Lines",
    "OutputError",
    "Problem",
    "RunRefused",
    "SceneError",
    "SetupFailure",
    "UsageError",
    "did_you_mean",
    "nearest_name",
    "shortened_repr",
]
