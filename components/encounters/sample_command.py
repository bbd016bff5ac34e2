"""``dsa-des encounters sample``: tracks of an encounter model as a table."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from components.encounters.draws import EncounterDraws
from components.encounters.model import EncounterModel
from components.encounters.model_file import ModelFileError, read_model
from components.encounters.sampling import SampledTracks, TrackSampler
from components.encounters.streamed_file import streamed
from components.encounters.track_rules import TrackError, TrackRules, accepted_tracks
from dsa_des.arrays.types import AnyArray
from dsa_des.errors import OutputError, UsageError
from dsa_des.errors.budgets import foreseen
from dsa_des.files.input_files import InputFileError, resolve_home
from dsa_des.files.output_file import check_file
from dsa_des.files.output_names import named, reason_of
from dsa_des.terminal.terminal import say

#: Purpose of the draws: without rejections raw tracks and flown ones are the same.
TRACKS = "tracks"
# Processor time (s) and bytes of a row, as measured with a small model.
_RAW_ROW, _FLOWN_ROW = (1e-6, 60.0), (4e-6, 160.0)


def sample_tracks(
    model: str,
    count: int,
    first: int,
    duration_s: float,
    seed: int,
    raw: bool,
    dynamics: str,
    out: str,
) -> None:
    """Write the tracks that the command line asks for.

    Raises
    ------
    UsageError
        If the model cannot be used, or the table not be written.
    OutputError
        If writing fails.
    """
    found = open_model(model)
    path = named(out)
    check_file(path)
    seconds = int(duration_s)
    if seconds != duration_s:
        raise UsageError(
            f"--duration-s {duration_s:g}: must be a whole number, as tracks have 1 Hz"
        )
    asked = f"--count {count} --duration-s {seconds}"
    each = _RAW_ROW if raw else _FLOWN_ROW
    if long := foreseen(asked, count * (seconds + 1), *each):
        say(f"note: {long}", err=True)
    batches = _raw(found, seed, range(first, first + count), seconds)
    if not raw:
        batches = _flown(found, seed, range(first, first + count), seconds, dynamics)
    try:
        rows = _write(path, batches)
    except TrackError as error:
        raise UsageError(f"{model}: {error}") from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error)}") from error
    for note in found.notes:
        say(f"note: {note}")
    say(f"{path}: {count} tracks of {seconds} s, {rows} rows")


def open_model(text: str) -> EncounterModel:
    """Return the model in a file that a user named.

    Raises
    ------
    UsageError
        If there is none.
    """
    try:
        return read_model(resolve_home(text))
    except ModelFileError as error:
        raise UsageError(str(error)) from None
    except InputFileError as error:
        raise UsageError(f"{text}: {error}") from None


_Columns = dict[str, AnyArray]


def _raw(model: EncounterModel, seed: int, numbers: range, seconds: int) -> Iterator[_Columns]:
    """Give what the network gave, before any rejection."""
    sampler = TrackSampler(model, EncounterDraws(seed, TRACKS))
    for tracks in sampler.batches(numbers, seconds):
        yield _variables(model, tracks, seconds)


def _variables(model: EncounterModel, tracks: SampledTracks, seconds: int) -> _Columns:
    """Return track, time and all variables, track after track."""
    instants = seconds + 1
    columns: _Columns = {
        "track": np.repeat(tracks.numbers, instants),
        "t_s": np.tile(np.arange(instants), len(tracks.numbers)),
    }
    for place, label in enumerate(model.labels):
        if place in model.dynamic:
            values = tracks.changing[:, model.dynamic.index(place)].T.reshape(-1)
        else:
            values = np.repeat(tracks.initial[place], instants)
        if model.bins[place].edges is None:
            values = values.astype(np.int64)
        columns[label] = values
    return columns


def _flown(
    model: EncounterModel, seed: int, numbers: range, seconds: int, dynamics: str
) -> Iterator[_Columns]:
    """Give accepted tracks with the positions they fly through, once per second."""
    sampler = TrackSampler(model, EncounterDraws(seed, TRACKS))
    rules = TrackRules(model)
    for tracks, flown in accepted_tracks(sampler, rules, numbers, seconds, dynamics):
        each = round(1.0 / flown.step_s)
        columns = _variables(model, tracks, seconds)
        for name, values in (
            ("north_ft", flown.north_ft),
            ("east_ft", flown.east_ft),
            ("altitude_ft", flown.up_ft),
            ("speed_ft_s", flown.speed_ft_s),
            ("heading_deg", np.degrees(flown.heading_rad)),
            ("climb_ft_s", flown.climb_ft_s),
        ):
            columns[name] = values[::each].T.reshape(-1)
        yield columns


def _write(path: Path, batches: Iterator[_Columns]) -> int:
    """Write batches as one CSV table; return how many rows it has."""
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    rows = 0
    plain = pa_csv.WriteOptions(include_header=False)
    with streamed(path) as file:
        for columns in batches:
            if not rows:
                header = io.StringIO()
                csv.writer(header, lineterminator="\n").writerow(columns)
                file.write(header.getvalue().encode())
            table = pa.table(columns)
            pa_csv.write_csv(table, file, plain)
            rows += table.num_rows
    return rows
