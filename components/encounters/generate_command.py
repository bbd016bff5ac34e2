"""``dsa-des encounters generate``: sets of encounters from encounter models."""

import math

import numpy as np

from components.encounters.pair_densities import PairingRules
from components.encounters.pair_sets import set_of_pairs
from components.encounters.pairing import PairSampler
from components.encounters.sample_command import open_model
from components.encounters.set_file import set_writer
from components.encounters.track_rules import TrackError
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import check_file
from dsa_des.files.output_names import named, reason_of
from dsa_des.terminal.terminal import say


def generate_set(
    model: str,
    intruder_model: str | None,
    count: int,
    first: int,
    seed: int,
    at: tuple[float, float],
    out: str,
) -> None:
    """Write a set of paired encounters.

    Raises
    ------
    UsageError
        If a model cannot be used, or the set not be written.
    OutputError
        If writing fails.
    """
    check_place(at)
    own = open_model(model)
    intruder = own if intruder_model is None else open_model(intruder_model)
    path = named(out)
    check_file(path)
    rules = PairingRules()
    about = {"models": [own.name, intruder.name], "seed": seed, "made_by": "uncorrelated pairing"}
    total, squares, attempts = 0.0, 0.0, 0
    try:
        pairing = PairSampler(own, intruder, seed, rules)
        with set_writer(path, about) as writer:
            for pairs in pairing.batches(range(first, first + count)):
                writer.write(set_of_pairs(pairs, rules.closest_s, at, str(path)))
                total += math.fsum(pairs.weight)
                squares += math.fsum(pairs.weight**2)
                attempts += int(np.sum(pairs.attempts + 1))
    except TrackError as error:
        raise UsageError(f"{model}: {error}") from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error)}") from error
    say(f"{path}: {count} encounters of {rules.duration_s} s")
    say(f"effective sample size {total * total / squares:.1f}; {attempts} proposals")


def check_place(at: tuple[float, float]) -> None:
    """Raise UsageError unless a latitude and a longitude are usable as the origin of a set."""
    if not (math.isfinite(at[0]) and abs(at[0]) <= 89.0 and abs(at[1]) <= 360.0):
        raise UsageError(
            f"--at {at[0]} {at[1]}: latitude must lie within ±89, longitude within ±360 degrees"
        )
