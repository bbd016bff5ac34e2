"""``dsa-des encounters sample`` and ``generate``: tracks and sets of encounter models."""

import csv
import io
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from components.arguments.units import FOOT_M
from components.encounters.made_encounters import make_set, read_recipe
from components.encounters.model import EncounterModel
from components.encounters.model_file import ModelFileError, read_model
from components.encounters.pair_densities import (
    REFERENCE_FT,
    PairingRules,
    pairing_rules,
    relative_speed_over_directions,
)
from components.encounters.pairing import (
    COURSES,
    PairSampler,
    draw_intruder_courses_rad,
    encounter_set_of_pairs,
    is_pair_accepted,
)
from components.encounters.sampling import EncounterDraws, SampledTracks, TrackSampler
from components.encounters.track_rules import TrackError, TrackRules, sample_accepted_tracks
from components.formats.encounter_set import NAMES, EncounterSet
from components.formats.public_formats import SET, set_of_tracks
from components.formats.recorded.known_kinds import recording_of_file
from components.formats.recorded.paired_tracks import (
    TrackWindows,
    is_flying,
    place_other_path,
    turn_path,
)
from components.formats.set_file import is_origin, write_set
from components.formats.text_rows import TrafficFileError
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.errors import OutputError, UsageError
from dsa_des.errors.budgets import describe_long_work
from dsa_des.files.input_files import InputFileError, is_folder, resolve_home
from dsa_des.files.output_file import check_file_ending, check_file_writable, stream_file
from dsa_des.files.output_names import system_error_text, user_path
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
    """Sample tracks of an encounter model and write them as a CSV table."""
    encounter_model = open_model(model)
    path = user_path(out)
    check_file_writable(path)
    seconds = int(duration_s)
    if seconds != duration_s:
        raise UsageError(
            f"--duration-s {duration_s:g}: must be a whole number, as tracks have 1 Hz"
        )
    asked = f"--count {count} --duration-s {seconds}"
    each = _RAW_ROW if raw else _FLOWN_ROW
    if long := describe_long_work(asked, count * (seconds + 1), *each):
        say(f"note: {long}", err=True)
    batches = _raw_track_batches(encounter_model, seed, range(first, first + count), seconds)
    if not raw:
        batches = _accepted_track_batches(
            encounter_model, seed, range(first, first + count), seconds, dynamics
        )
    try:
        rows = _write_csv(path, batches)
    except TrackError as error:
        raise UsageError(str(error)) from None
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {system_error_text(error)}") from error
    for note in encounter_model.notes:
        say(f"note: {model}: {note}")
    say(f"{path}: {count} tracks of {seconds} s, {rows} rows")


def open_model(text: str) -> EncounterModel:
    """Return the encounter model of a file named by a user; UsageError if it cannot be used."""
    try:
        return read_model(resolve_home(text))
    except ModelFileError as error:
        raise UsageError(str(error)) from None
    except InputFileError as error:
        raise UsageError(f"{text}: {error}") from None


_Columns = dict[str, AnyArray]


def _raw_track_batches(
    model: EncounterModel, seed: int, numbers: range, seconds: int
) -> Iterator[_Columns]:
    """Yield batches of columns with every track's sampled variables, before any rejection."""
    sampler = TrackSampler(model, EncounterDraws(seed, TRACKS))
    for tracks in sampler.batches(numbers, seconds):
        yield _track_columns(model, tracks, seconds)


def _track_columns(model: EncounterModel, tracks: SampledTracks, seconds: int) -> _Columns:
    """Return columns of number, time and all variables, one row per second, track after track."""
    instants = seconds + 1
    columns: _Columns = {
        "track": np.repeat(tracks.numbers, instants),
        "t_s": np.tile(np.arange(instants), len(tracks.numbers)),
    }
    for index, label in enumerate(model.labels):
        if index in model.dynamic_indices:
            values = tracks.changing[:, model.dynamic_indices.index(index)].T.reshape(-1)
        else:
            values = np.repeat(tracks.initial[index], instants)
        if model.bins[index].edges is None:
            values = values.astype(np.int64)
        columns[label] = values
    return columns


def _accepted_track_batches(
    model: EncounterModel, seed: int, numbers: range, seconds: int, dynamics: str
) -> Iterator[_Columns]:
    """Yield batches of accepted tracks as columns: variables, positions and motion each second."""
    sampler = TrackSampler(model, EncounterDraws(seed, TRACKS))
    rules = TrackRules(model)
    for tracks, flown in sample_accepted_tracks(sampler, rules, numbers, seconds, dynamics):
        each = round(1.0 / flown.step_s)
        columns = _track_columns(model, tracks, seconds)
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


def _write_csv(path: Path, batches: Iterator[_Columns]) -> int:
    """Write batches of columns as one CSV table and return its number of rows."""
    import pyarrow as pa
    import pyarrow.csv as pa_csv

    rows = 0
    plain = pa_csv.WriteOptions(include_header=False)
    with stream_file(path) as file:
        for columns in batches:
            if not rows:
                header = io.StringIO()
                csv.writer(header, lineterminator="\n").writerow(columns)
                file.write(header.getvalue().encode())
            table = pa.table(columns)
            pa_csv.write_csv(table, file, plain)
            rows += table.num_rows
    return rows


# Processor time (s) and bytes of an encounter, as measured with a small model.
_PAIR = (1e-3, 900.0)


def generate_set(
    made: str | None,
    tracks: str | None,
    model: str | None,
    intruder_model: str | None,
    count: int | None,
    first: int,
    seed: int,
    at: tuple[float, float],
    horizontal: tuple[str, str] | None,
    vertical: tuple[str, str] | None,
    out: str,
) -> None:
    """Write a set of encounters from models, recorded flights or a table made by hand."""
    check_origin(at)
    if made is not None:
        if any(one is not None for one in (tracks, model, intruder_model, count)):
            raise UsageError(
                "--made says all of its encounters: no --model, --tracks and --count with it"
            )
        if horizontal is not None or vertical is not None:
            raise UsageError("--horizontal and --vertical belong to --model, not to --made")
        _write_made(made, out)
        return
    if tracks is not None and (model is not None or intruder_model is not None):
        raise UsageError("--tracks are flown by both aircraft: no --model with them")
    if tracks is not None and count is not None:
        _write_recorded_pairs(
            tracks, range(first, first + count), seed, at, horizontal, vertical, out
        )
        return
    if model is None or count is None:
        raise UsageError(
            "either --model FILE and --count N are needed, or --tracks FOLDER and --count N, or "
            "--made FILE.toml"
        )
    own = open_model(model)
    intruder = own if intruder_model is None else open_model(intruder_model)
    path = user_path(out)
    check_file_ending(path, [SET])
    check_file_writable(path)
    rules = _parse_pairing_rules(horizontal, vertical)
    if long := describe_long_work(f"--count {count}", count, *_PAIR):
        say(f"note: {long}", err=True)
    about = {"models": [own.name, intruder.name], "seed": seed, "made_by": "uncorrelated pairing"}
    total, squares, attempts = 0.0, 0.0, 0

    def sets_of_batches(pairing: PairSampler) -> Iterator[EncounterSet]:
        nonlocal total, squares, attempts
        for pairs in pairing.batches(range(first, first + count)):
            total += math.fsum(pairs.weight)
            squares += math.fsum(pairs.weight**2)
            attempts += int(np.sum(pairs.attempts + 1))
            yield encounter_set_of_pairs(pairs, rules.closest_s, at, str(path))

    try:
        pairing = PairSampler(own, intruder, seed, rules)
        write_set(path, about, sets_of_batches(pairing))
    except TrackError as error:
        raise UsageError(str(error)) from None
    for file, notes in {one.path: one.notes for one in (own, intruder)}.items():
        for note in notes:
            say(f"note: {file}: {note}")
    say(f"{path}: {count} encounters of {rules.duration_s} s")
    say(f"effective sample size {total * total / squares:.1f}; {attempts} proposals")


#: Proposals of one pair of tracks that may be rejected.
_MOST_TRIES = 10_000
_OF_TRACKS = "pairs of tracks"


def _write_recorded_pairs(
    folder: str,
    numbers: range,
    seed: int,
    at: tuple[float, float],
    horizontal: tuple[str, str] | None,
    vertical: tuple[str, str] | None,
    out: str,
) -> None:
    """Write a set of encounters, each a pair of recorded flights moved to meet."""
    path = user_path(out)
    check_file_ending(path, [SET])
    check_file_writable(path)
    rules = _parse_pairing_rules(horizontal, vertical)
    try:
        place = resolve_home(folder)
        if not is_folder(place):
            raise UsageError(f"--tracks {folder}: must be a folder of recorded flights")
        files = sorted(p for p in place.iterdir() if p.is_file() and p.name[0] != ".")
        flights = [one for file in files for one in recording_of_file(file).samples.values()]
    except InputFileError as error:
        raise UsageError(f"--tracks {folder}: {error}") from None
    except TrafficFileError as error:
        raise UsageError(*str(error).split("\n")) from None
    windows = TrackWindows(flights, rules.duration_s, rules.closest_s)
    if windows.flights < 2:
        raise UsageError(
            f"--tracks {folder}: {len(flights)} flights, of which {windows.flights} are known for "
            f"{rules.duration_s} s without a gap: two at least must be"
        )
    draws = EncounterDraws(seed, _OF_TRACKS)
    made = [_pair_recorded_flights(windows, draws, rules, number) for number in numbers]
    times_s = np.arange(rules.duration_s + 1.0)
    pairs = [
        [(name, (times_s, *one)) for name, one in zip(NAMES, both, strict=True)]
        for _, both, _ in made
    ]
    weights = [weight for weight, _, _ in made]
    encounters = set_of_tracks(str(path), list(numbers), weights, pairs, at)
    about = {"made_by": "pairs of recorded flights", "flights": len(flights), "seed": seed}
    write_set(path, about, [encounters])
    total, squares = math.fsum(weights), math.fsum(weight**2 for weight in weights)
    say(f"{path}: {len(numbers)} encounters of {rules.duration_s} s")
    say(f"of {windows.flights} of {len(flights)} flights, {windows.count:,} windows")
    say(
        f"effective sample size {total * total / squares:.1f}; "
        f"{sum(tries for _, _, tries in made)} proposals"
    )


def _pair_recorded_flights(
    windows: TrackWindows, draws: EncounterDraws, rules: PairingRules, number: int
) -> tuple[float, tuple[FloatArray, FloatArray], int]:
    """Return a flight pair's weight, both paths (m) and the number of proposals until accepted."""
    who = np.array([number])
    for attempt in range(_MOST_TRIES):
        drawn = draws.uniform(who, 4 + 2 * COURSES, attempt)
        (first, own), (second, other) = (
            windows.window_at_share(float(share[0])) for share in drawn[:2]
        )
        speeds = [windows.velocity_at_closest(path) for path in (own, other)]
        if first == second or not all(map(is_flying, speeds)):
            continue
        level = [np.array([np.hypot(v[0], v[1])]) / FOOT_M for v in speeds]
        climb = np.array([speeds[1][2] - speeds[0][2]]) / FOOT_M
        course = draw_intruder_courses_rad(level[0], level[1], climb, drawn[4:])
        density, accept = rules.horizontal_ft, rules.vertical_ft
        miss_ft = density.quantile_of_area(drawn[2] * density.area)
        up_ft = accept.quantile_of_area(drawn[3] * accept.area)
        north, east = level[1] * np.cos(course) - level[0], level[1] * np.sin(course)
        relative = np.maximum(np.hypot(north, east), 1e-9)
        place_m = miss_ft * FOOT_M * np.array([east, -north]) / relative
        own = turn_path(own, speeds[0], 0.0)
        other = turn_path(other, speeds[1], float(course[0]))
        other = place_other_path(
            own, other, rules.closest_s, (float(place_m[0, 0]), float(place_m[1, 0])),
            float(up_ft[0]) * FOOT_M,
        )  # fmt: skip
        paths_ft = np.stack([own, other], axis=1)[..., np.newaxis] / FOOT_M
        if is_pair_accepted(rules, list(paths_ft), miss_ft, up_ft)[0]:
            q = density.value_at(miss_ft) / density.area
            chance = accept.value_at(up_ft) / accept.heights.max()
            weight = relative_speed_over_directions(level[0], level[1], climb) / (
                2.0 * REFERENCE_FT
            )
            return float((weight / q / chance)[0]), (own, other), attempt + 1
    raise UsageError(
        f"pair {number} was rejected {_MOST_TRIES} times: the flights do not meet as the rules ask"
    )


def _parse_pairing_rules(
    horizontal: tuple[str, str] | None, vertical: tuple[str, str] | None
) -> PairingRules:
    """Return pairing rules with command-line miss distances; UsageError if they do not fit."""
    steps = []
    for option, given in (("--horizontal", horizontal), ("--vertical", vertical)):
        try:
            steps.append(given and [[float(word) for word in text.split(",")] for text in given])
        except ValueError:
            raise UsageError(
                f"{option} {' '.join(given or ())}: must be rising edges, ft, and the proportion "
                "of each step between two, all with commas between them"
            ) from None
    try:
        return pairing_rules(*steps)
    except ValueError as error:
        name, _, why = str(error).partition(": ")
        given = horizontal if name == "horizontal" else vertical
        raise UsageError(f"--{name} {' '.join(given or ())}: {why}") from None


def _write_made(made: str, out: str) -> None:
    recipe = read_recipe(made)
    path = user_path(out)
    check_file_ending(path, [SET])
    check_file_writable(path)
    encounters = make_set(recipe)
    write_set(path, {"made_by": "hand", "seed": recipe.seed}, [encounters])
    say(f"{path}: {len(encounters)} encounters of {recipe.duration_s:g} s")


def check_origin(at: tuple[float, float]) -> None:
    """Raise UsageError unless a latitude and a longitude are usable as the origin of a set."""
    if not is_origin(at):
        raise UsageError(
            f"--at {at[0]} {at[1]}: latitude must lie within ±89, longitude within ±360 degrees"
        )
