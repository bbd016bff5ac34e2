"""``dsa-des encounters convert``: sets from public formats, and back."""

import numpy as np

from components.encounters.any_format import SET, WAYPOINTS, read_encounters
from components.encounters.encounter_set import EncounterSet
from components.encounters.generate_command import check_place
from components.encounters.public_formats import waypoints_of
from components.encounters.set_file import EncounterSetError, set_writer
from components.encounters.table_file import kept_rows, numbers, read_table
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.input_files import InputFileError, resolve_home
from dsa_des.files.output_file import check_file, write_file
from dsa_des.files.output_names import named, reason_of
from dsa_des.terminal.terminal import say


def convert_sets(
    files: tuple[str, ...],
    weights: str | None,
    at: tuple[float, float] | None,
    skip_damaged: bool,
    out: str,
) -> None:
    """Write what is in some files as one set, or as a file of waypoints.

    Raises
    ------
    UsageError
        With what is wrong, naming file and encounter.
    OutputError
        If writing fails.
    """
    if at is not None:
        check_place(at)
    path = named(out)
    if path.suffix.lower() not in (SET, *WAYPOINTS):
        raise UsageError(f"--out {out}: must end in {SET}, or in {' or '.join(WAYPOINTS)}")
    check_file(path)
    try:
        found = read_encounters([resolve_home(text) for text in files], at, skip_damaged)
        if weights is not None:
            found = EncounterSet(**{**vars(found), "weights": _weights(weights, found)})
        if path.suffix.lower() == SET:
            with set_writer(path, {"made_by": "conversion"}) as writer:
                writer.write(found)
        else:
            write_file(path, waypoints_of(found))
    except InputFileError as error:
        raise UsageError(str(error)) from None
    except EncounterSetError as error:
        raise UsageError(*str(error).split("\n")) from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error)}") from error
    say(f"{path}: {len(found)} encounters")
    if found.skipped:
        say(f"{found.skipped} damaged encounters were skipped")


def _weights(text: str, found: EncounterSet) -> FloatArray:
    """Return the weights that a table with the columns ``encounter`` and ``weight`` gives."""
    table = read_table(text)
    number, wrong = numbers(table, "encounter", "--weights", flag=False)
    weight, also = numbers(table, "weight", "--weights", flag=False)
    kept_rows(table, [wrong, also], skip=False)
    known = dict(zip(number.astype(np.int64).tolist(), weight.tolist(), strict=True))
    missing = [n for n in found.numbers.tolist() if n not in known]
    if missing:
        raise UsageError(f"{text}: encounter {missing[0]}: weight is missing")
    weights = np.array([known[n] for n in found.numbers.tolist()])
    if not (weights > 0.0).any():
        raise UsageError(f"{text}: all weights are 0")
    return weights
