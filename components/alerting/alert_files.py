"""``dsa-des alert``: tables and figures of recorded encounters."""

import math
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from components.alert_configuration.conf_file import read_conf
from components.alert_configuration.configuration import Configuration
from components.alerting.alert_figure import draw_alerts
from components.alerting.alert_tables import alert_table_csv, bands_table_csv, remove_hysteresis
from components.alerting.encounter import Encounter, read_encounter
from components.alerting.levels import Alerts, alert_levels
from components.formats.recorded.traffic_of_files import TrafficChoice
from components.formats.text_rows import SPEED_MPS, TrafficFileError
from dsa_des.block.shipped_files import existing_or_shipped_path
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.input_files import InputFileError, is_folder, resolve_home
from dsa_des.files.output_file import PICTURES, check_file_ending, check_file_writable, write_file
from dsa_des.files.output_folder import OutputFolder
from dsa_des.files.output_names import system_error_text, user_path
from dsa_des.terminal.tables import print_table
from dsa_des.terminal.terminal import console, say

_SUFFIXES = (".daa", ".xyz")
_OTHER_PROBLEMS = 5


class _Done(NamedTuple):
    """One encounter file, what was read from it, and its alerts."""

    path: Path
    encounter: Encounter
    alerts: Alerts


def write_alert_files(
    encounters: tuple[str, ...],
    conf: str,
    out: str,
    no_hysteresis: bool,
    figure: str | None,
    bands: str | None,
    wind: tuple[float, float] | None,
    ownship: str | None,
    own_file: str | None,
    decimals: int,
) -> None:
    """Write the tables and figures that the command line asks for."""
    paths, several = _list_encounter_files(encounters)
    names = {"--out": out, "--figure": figure, "--bands": bands}
    places = {option: user_path(name, option) for option, name in names.items() if name is not None}
    for (option, path), (other, its) in combinations(places.items(), 2):
        if path.resolve() == its.resolve():
            raise UsageError(f"{other} and {option} name the same place: each needs its own")
    for option, path in places.items():
        if several:
            OutputFolder(path).check()
        else:
            if option == "--figure":
                check_file_ending(path, PICTURES, option)
            check_file_writable(path, option)
    configuration = _read_configuration(Path(conf))
    if no_hysteresis:
        configuration = remove_hysteresis(configuration)
    own = None if own_file is None else Path(own_file)
    choice = TrafficChoice(ownship=ownship, own_file=own)
    done = _compute_alerts(configuration, paths, _wind_mps(wind), choice)
    try:
        if several:
            _write_folders(configuration, done, places, decimals)
        else:
            for option, path in places.items():
                _write_output(option, configuration, done[0], path, decimals)
    except OSError as error:
        raise OutputError(
            f"{error.filename or out}: cannot be written: {system_error_text(error)}"
        ) from (error)
    _print_summary(configuration, done, places)


def _list_encounter_files(encounters: tuple[str, ...]) -> tuple[list[Path], bool]:
    """Return encounter files, named or in named folders, and whether outputs must be folders."""
    result: list[Path] = []
    several = len(encounters) > 1
    for text in encounters:
        try:
            path = existing_or_shipped_path(resolve_home(text), text)
        except InputFileError as error:
            raise UsageError(f"{text}: {error}") from error
        if not is_folder(path):
            result.append(path)
            continue
        several = True
        inside = sorted(p for p in path.iterdir() if p.suffix.lower() in _SUFFIXES)
        if not inside:
            raise UsageError(f"{text}: the folder holds no {' or '.join(_SUFFIXES)} file")
        result += inside
    stems: dict[str, Path] = {}
    for path in result:
        other = stems.setdefault(path.stem, path)
        if other is not path:
            raise UsageError(f"{other} and {path} would both be written to {path.stem}.csv")
    return result, several


def _read_configuration(path: Path) -> Configuration:
    try:
        return read_conf(path)
    except TrafficFileError as error:
        raise UsageError(*str(error).split("\n")) from error


def _compute_alerts(
    configuration: Configuration,
    paths: list[Path],
    wind_mps: tuple[float, float] | None,
    choice: TrafficChoice,
) -> list[_Done]:
    """Return the alerts of all files; one UsageError for all files that cannot be used."""
    done, problems = [], []
    for path in paths:
        try:
            encounter = read_encounter(path, configuration, wind_mps, choice)
        except TrafficFileError as error:
            problems.append(str(error).split("\n"))
            continue
        alerts = alert_levels(
            configuration,
            encounter.time_s,
            encounter.present,
            encounter.pairs,
            encounter.alerter,
        )
        done.append(_Done(path, encounter, alerts))
    if problems:
        lines = [line for problem in problems[:_OTHER_PROBLEMS] for line in problem]
        if len(problems) > _OTHER_PROBLEMS:
            lines.append(f"and {len(problems) - _OTHER_PROBLEMS} more files with problems")
        raise UsageError(*lines)
    return done


def _wind_mps(wind: tuple[float, float] | None) -> tuple[float, float] | None:
    """Return the command line's wind as velocity east and north, m/s; None where it is not set."""
    if wind is None:
        return None
    towards_deg, knots = wind
    if not (math.isfinite(towards_deg) and math.isfinite(knots) and knots >= 0.0):
        raise UsageError(
            f"--wind is {towards_deg:g} {knots:g}: a direction and a speed that is not negative "
            "are needed"
        )
    towards, speed = math.radians(towards_deg), knots * SPEED_MPS["knot"]
    return speed * math.sin(towards), speed * math.cos(towards)


def _write_folders(
    configuration: Configuration, done: list[_Done], places: dict[str, Path], decimals: int
) -> None:
    for option, target in places.items():
        suffix = ".png" if option == "--figure" else ".csv"
        with OutputFolder(target).write_then_rename() as folder:
            for one in done:
                path = folder / f"{one.path.stem}{suffix}"
                _write_output(option, configuration, one, path, decimals)


def _write_output(
    option: str, configuration: Configuration, one: _Done, path: Path, decimals: int
) -> None:
    if option == "--figure":
        draw_alerts(path, one.path.stem, configuration, one.encounter, one.alerts)
        return
    table = bands_table_csv if option == "--bands" else alert_table_csv
    write_file(path, table(configuration, one.encounter, one.alerts, decimals).encode())


def _print_summary(
    configuration: Configuration, done: list[_Done], places: dict[str, Path]
) -> None:
    """Print a table of when each level first comes on by target, then notes and files written."""
    levels = range(1, configuration.most_levels + 1)
    rows = []
    for one in done:
        for number, target in enumerate(one.encounter.targets):
            level = one.alerts.level[:, number]
            seen = [one.encounter.time_s[level == k] for k in levels]
            firsts = [f"{times[0]:.1f}" if len(times) else "" for times in seen]
            highest = int(np.max(level, initial=0))
            rows.append([one.path.name, target, str(highest), *firsts])
    headings = ["file", "target", "highest level", *(f"level {k} from, s" for k in levels)]
    right = range(2, len(headings))
    print_table(console(), "Alerts, times as in the files", headings, rows, right=right)
    for note in configuration.notes():
        say(f"note: {note}")
    for one in done:
        for note in one.encounter.notes:
            say(f"note: {one.path}: {note}")
        if one.encounter.left_out:
            say(
                f"note: {one.path}: {one.encounter.left_out} rows of targets are left out: the "
                "ownship has none at their times"
            )
    for path in places.values():
        say(f"written: {path}")
