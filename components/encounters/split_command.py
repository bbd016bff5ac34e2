"""``dsa-des encounters split``: a set in which encounters that matter stand more often."""

import math

import numpy as np

from components.encounters.any_format import SET
from components.encounters.encounter_set import EncounterSet
from components.encounters.set_file import EncounterSetError, read_set, set_writer
from components.encounters.splitting import expected_copies, nearness, split_set
from components.encounters.table_file import kept_rows, numbers, read_table
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import OutputError, UsageError
from dsa_des.errors.budgets import refuse_samples
from dsa_des.files.input_files import InputFileError, resolve_home
from dsa_des.files.output_file import check_ending, check_file
from dsa_des.files.output_names import named, reason_of
from dsa_des.terminal.terminal import say


def split_encounters(
    file: str,
    levels: str,
    copies: str,
    scores: str | None,
    score: str | None,
    seed: int,
    out: str,
) -> None:
    """Write a set of copies of another set's encounters.

    Raises
    ------
    UsageError
        If the set or the scores cannot be used.
    OutputError
        If writing fails.
    """
    if (scores is None) != (score is None):
        raise UsageError("--scores TABLE and --score COLUMN belong together: give both, or neither")
    path = named(out)
    check_ending(path, [SET])
    check_file(path)
    try:
        found = read_set(resolve_home(file))
    except (EncounterSetError, InputFileError) as error:
        raise UsageError(*str(error).split("\n")) from None
    if scores is None or score is None:
        near = np.array([nearness(found, place) for place in range(len(found))])
    else:
        near = _scores(scores, score, found)
    try:
        expected = expected_copies(near, _numbers("--levels", levels), _numbers("--copies", copies))
    except ValueError as error:
        raise UsageError(f"--levels {levels} --copies {copies}: {error}") from None
    lengths = np.diff(found.starts[found.first_rows])
    refuse_samples(f"--copies {copies}", float(np.sum(expected * lengths)))
    made = split_set(found, expected, seed)
    if not len(made):
        raise UsageError(f"{file}: no encounter is left; more copies are needed")
    try:
        with set_writer(path, {"made_by": "splitting", "of": str(file), "seed": seed}) as writer:
            writer.write(made)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error)}") from error
    families = len(np.unique(made.extra["family"]))
    say(f"{path}: {len(made)} encounters, copies of {families} of {len(found)}")
    say(f"sum of weights {math.fsum(made.weights):.6g}, of the set {math.fsum(found.weights):.6g}")


def _numbers(option: str, text: str) -> FloatArray:
    try:
        return np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise UsageError(f"{option} {text}: must be numbers with commas between them") from None


def _scores(text: str, column: str, found: EncounterSet) -> FloatArray:
    """Return each encounter's least value in a table or a study's folder."""
    table = read_table(text)
    number, wrong = numbers(table, "encounter", "--scores", flag=False)
    value, also = numbers(table, column, "--score", flag=False)
    kept_rows(table, [wrong, also], skip=False)
    least: dict[int, float] = {}
    for n, v in zip(number.astype(np.int64).tolist(), value.tolist(), strict=True):
        least[n] = min(v, least.get(n, math.inf))
    missing = [n for n in found.numbers.tolist() if n not in least]
    if missing:
        raise UsageError(f"{text}: encounter {missing[0]}: {column} is missing")
    return np.array([least[n] for n in found.numbers.tolist()])
