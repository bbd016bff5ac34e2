"""Runs and recorded encounters as the page shows them: all in one plane and one time."""

import json
import tomllib
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from components.display.picture import TangentPlane, offset_positions, sights
from components.display.recorded_run import RecordedTables, read_table
from components.display.symbols import block_marks
from components.formats.daa_file import read_daa_samples
from components.formats.text_rows import TrafficFileError
from components.messages.alerts import BAND_REGIONS
from components.messages.columns import ORIGIN
from components.view.page import RunPicture
from dsa_des.arrays.types import AnyArray, FloatArray
from dsa_des.block.mark import Mark
from dsa_des.errors import UsageError

_NO_TARGET = -1
#: What the page shows of a run; the first two are in every run.
_TABLES = (
    "detections", "scans", "truth", "fused", "tracks", "state_tracks", "alerts", "manoeuvres",
    "bands",
)  # fmt: skip
_OWN = ("own_lat_deg", "own_lon_deg", "own_alt_m", "own_heading_rad", "own_pitch_rad",
        "own_roll_rad")  # fmt: skip
_LEVELS = tuple(f"time_to_level_{level}_s" for level in (1, 2, 3, 4))


class _RunColumns(dict[str, Any]):
    """A table's columns, as they are asked for."""

    def __init__(self, run: RecordedTables, table: str) -> None:
        super().__init__()
        self._run, self._table = run, table

    def __contains__(self, name: object) -> bool:
        return name in self._run.table(self._table).column_names

    def __missing__(self, name: str) -> Any:
        self[name] = self._run.values(self._table, name)
        return self[name]


def run_picture(folder: Path) -> RunPicture:
    """Return the page's picture of a run; `UsageError` where the folder holds none."""
    info = _json(folder / "run.json")
    scene = _toml(folder / "scene.toml")
    paths = {name: folder / f"{name}.parquet" for name in _TABLES}
    if not all(paths[name].is_file() for name in _TABLES[:2]):
        raise UsageError(f"{folder}: holds no run: scans.parquet or detections.parquet is missing")
    tables = {name: read_table(path) for name, path in paths.items() if path.is_file()}
    run = RecordedTables(folder, tables)
    found = {name: _RunColumns(run, name) for name in tables}
    detections = found["detections"]
    names = _names(found)
    own = _own(found)
    plane = _plane(own)
    picture = RunPicture(
        title=str(scene.get("title") or folder.name),
        facts=_facts(info, scene),
        duration_s=float(info.get("duration_s", 0.0)),
        targets=names,
    )
    sensors = sorted(set(_text(found["scans"]["block"])) | set(_text(detections["block"])))
    blocks = {name: scene.get("blocks", {}).get(name, {}) for name in sensors}
    marks = block_marks({name: str(block.get("type", "")) for name, block in blocks.items()})
    picture.sensors = [_sensor(name, blocks[name], marks[name]) for name in sensors]
    targets = {name: number for number, name in enumerate(names)}
    picture.tables["own"] = _own_columns(own, plane)
    if "truth" in found:
        picture.tables["truth"] = _truth(found["truth"], plane, targets)
    picture.tables["scans"] = {
        "time_s": found["scans"]["time_s"],
        "sensor": _codes(found["scans"]["block"], sensors),
        "detected": found["scans"]["detected"],
    }
    seen = _seen(detections, detections, plane)
    picture.tables["detections"] = {
        "time_s": detections["time_s"],
        "sensor": _codes(detections["block"], sensors),
        "target": _codes(detections["target"], targets),
        "scan": detections["scan"],
        **seen,
    }
    for name in ("fused", "tracks"):
        if name in found and "azimuth_rad" in found[name]:
            table = found[name]
            if name == "tracks":
                picture.trackers = _trackers(table)
            picture.tables[name] = {
                "time_s": table["time_s"],
                "target": _codes(table["target"], targets),
                **_seen(table, _pose_at(own, table["time_s"]), plane),
                **({"age_s": table["age_s"]} if "age_s" in table else {}),
                **_sources(table),
            }
    if "state_tracks" in found:
        table = found["state_tracks"]
        picture.trackers = _trackers(table)
        picture.tables["tracks"] = _estimates(table, picture.trackers, own, plane)
    if "alerts" in found:
        table = found["alerts"]
        picture.tables["alerts"] = {
            "time_s": table["time_s"],
            "target": _codes(table["target"], targets),
            "level": table["level"],
            **_sources(table),
            **({"track": _whole(table["track"])} if "track" in table else {}),
            **{name: table[name] for name in _LEVELS if name in table},
        }
    if "manoeuvres" in found:
        table = found["manoeuvres"]
        columns = ("time_s", "turn_rad", "climb_m")
        picture.tables["manoeuvres"] = {name: table[name] for name in columns if name in table}
    if "bands" in found:
        table = found["bands"]
        ends = ("low_rad", "high_rad", "low_m", "high_m")
        picture.tables["bands"] = {
            "time_s": table["time_s"],
            "region": _codes(table["region"], BAND_REGIONS),
            **{name: table[name] for name in ends},
        }
    return picture


def _json(path: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path.parent}: holds no run: run.json: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f"{path}: is not JSON ({error})") from error
    return found


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError:
        return {}
    except ValueError as error:
        raise UsageError(f"{path}: is not TOML ({error})") from error


def _text(column: list[str | None]) -> list[str]:
    return [text for text in column if text is not None]


def _names(tables: Mapping[str, _RunColumns]) -> list[str]:
    """Return the targets of all tables, sorted."""
    found: set[str] = set()
    for name in ("truth", "detections", "alerts"):
        if name in tables and "target" in tables[name]:
            found.update(_text(tables[name]["target"]))
    return sorted(found)


def _codes(column: list[str | None], names: Any) -> AnyArray:
    """Return the number of each text among names, -1 for none."""
    known = names if isinstance(names, dict) else {name: i for i, name in enumerate(names)}
    codes = (_NO_TARGET if text is None else known.get(text, _NO_TARGET) for text in column)
    return np.fromiter(codes, dtype=np.int64, count=len(column))


def _sources(table: _RunColumns) -> dict[str, AnyArray]:
    """Return by number which block each row is of."""
    names = _trackers(table)
    return {"source": _codes(table["block"], names)} if names else {}


def _trackers(table: _RunColumns) -> list[str]:
    """Return the names of the blocks of a table, in the order of their numbers on the page."""
    return sorted(set(_text(table["block"]))) if "block" in table else []


def _whole(column: Any) -> AnyArray:
    """Return numbers of tracks, -1 where there is none."""
    numbers = np.asarray(column, dtype=float)
    return np.where(np.isfinite(numbers), numbers, _NO_TARGET).astype(np.int64)


def _facts(info: dict[str, Any], scene: dict[str, Any]) -> dict[str, Any]:
    facts = {"seed": info.get("seed"), "scene": str(info.get("scene_sha256", ""))[:12]}
    versions = info.get("versions")
    if isinstance(versions, dict):
        facts["version"] = versions.get("dsa-des") or versions.get("dsa_des")
    if scene.get("description"):
        facts["description"] = str(scene["description"])
    return {name: value for name, value in facts.items() if value not in (None, "")}


def _sensor(name: str, block: dict[str, Any], mark: Mark) -> dict[str, Any]:
    """Return how a sensor is shown, and its field of view as far as the scene says it."""
    found: dict[str, Any] = {"name": name, "colour": mark.colour, "marker": mark.marker}
    limits = block.get("azimuth_deg")
    if isinstance(limits, list) and len(limits) == 2:
        turned = float(block.get("mount_azimuth_deg", 0.0))
        found["azimuth_deg"] = [float(edge) + turned for edge in limits]
    if block.get("beam_sweep") is True and "azimuth_deg" in found:
        rate = Fraction(str(block["scan_rate_hz"])) * (
            1 + Fraction(str(block.get("rate_error_ppm", 0))) / 10**6
        )
        found["sweep_s"] = float(1 / rate)
    if isinstance(block.get("range_km"), int | float):
        found["range_m"] = 1000.0 * block["range_km"]
    return found


def _own(tables: Mapping[str, _RunColumns]) -> dict[str, FloatArray]:
    """Return where the ownship was and how it lay, in order of time: the truth, or its belief."""
    found: dict[str, FloatArray]
    truth = tables.get("truth")
    if truth is not None:
        mine = np.array([name is None for name in truth["target"]], dtype=bool)
        if mine.any():
            names = ("lat_deg", "lon_deg", "alt_m", "heading_rad", "pitch_rad", "roll_rad")
            if all(name in truth for name in names):
                found = {f"own_{name}": truth[name][mine] for name in names}
                return _in_order({"time_s": truth["time_s"][mine], **found})
    detections = tables["detections"]
    found = {name: np.asarray(detections[name], dtype=float) for name in ("time_s", *_OWN)}
    return _in_order(found)


def _in_order(own: dict[str, FloatArray]) -> dict[str, FloatArray]:
    time_s, first = np.unique(own["time_s"], return_index=True)
    return {**{name: values[first] for name, values in own.items()}, "time_s": time_s}


def _plane(own: Mapping[str, FloatArray]) -> TangentPlane:
    if len(own["time_s"]) == 0:
        return TangentPlane(0.0, 0.0)
    return TangentPlane(float(own["own_lat_deg"][0]), float(own["own_lon_deg"][0]))


def _own_columns(own: Mapping[str, FloatArray], plane: TangentPlane) -> dict[str, AnyArray]:
    east, north = plane.east_north_m(own["own_lat_deg"], own["own_lon_deg"], own["own_alt_m"])
    return {
        "time_s": own["time_s"],
        "east_m": east,
        "north_m": north,
        "alt_m": own["own_alt_m"],
        "heading_rad": np.unwrap(own["own_heading_rad"]) if len(east) else east,
    }


def _truth(
    truth: _RunColumns, plane: TangentPlane, targets: Mapping[str, int]
) -> dict[str, AnyArray]:
    """Return the targets' true positions, by target and then by time."""
    code = _codes(truth["target"], targets)
    keep = np.flatnonzero((code >= 0) & np.isfinite(truth["lat_deg"]))
    keep = keep[np.lexsort((truth["time_s"][keep], code[keep]))]
    position = [truth[name][keep] for name in ("lat_deg", "lon_deg", "alt_m")]
    east, north = plane.east_north_m(*position)
    return {
        "time_s": truth["time_s"][keep],
        "target": code[keep],
        "east_m": east,
        "north_m": north,
        "alt_m": position[2],
    }


def _estimates(
    table: _RunColumns, trackers: list[str], own: Mapping[str, FloatArray], plane: TangentPlane
) -> dict[str, AnyArray]:
    """Return estimated states of tracks that live; their frames are turned like the plane."""
    keep = np.flatnonzero(np.array([status != "deleted" for status in table["track_status"]]))

    def column(name: str) -> FloatArray:
        return np.asarray(table[name], dtype=float)[keep]

    time_s = column("time_s")
    ned_m = np.stack([column(name) for name in ("north_m", "east_m", "down_m")])
    ends = offset_positions(ned_m, [column(name) for name in ORIGIN])
    east, north = plane.east_north_m(*ends)
    pose = _pose_at(own, time_s)
    from_east, from_north = plane.east_north_m(*(pose[name] for name in _OWN[:3]))
    statuses = [table["track_status"][row] for row in keep.tolist()]
    return {
        "time_s": time_s,
        "number": np.asarray(table["track"])[keep],
        **({"source": _codes(table["block"], trackers)[keep]} if trackers else {}),
        "tentative": np.array([status == "tentative" for status in statuses], dtype=bool),
        "from_east_m": from_east,
        "from_north_m": from_north,
        "bearing_rad": column("azimuth_rad"),
        "east_m": east,
        "north_m": north,
        "alt_m": ends[2],
        "east_mps": column("east_m_s"),
        "north_mps": column("north_m_s"),
        "variance_north_m2": column("covariance_00_m2"),
        "covariance_m2": column("covariance_01_m2"),
        "variance_east_m2": column("covariance_11_m2"),
    }


def _pose_at(own: Mapping[str, FloatArray], time_s: FloatArray) -> dict[str, FloatArray]:
    """Return the ownship's latest pose at some times, NaN before the first."""
    row = np.searchsorted(own["time_s"], time_s, side="right") - 1
    found = {}
    for name in _OWN:
        values = np.append(own[name], np.nan)
        found[name] = values[row]
    return found


def _seen(table: _RunColumns, pose: Mapping[str, Any], plane: TangentPlane) -> dict[str, AnyArray]:
    """Return where measured lines of sight point, and where they end if they have a range.

    Bearings are from north; what is not known is NaN.
    """
    at = [np.asarray(pose[name], dtype=float) for name in _OWN]
    azimuth, elevation, range_m = (
        np.asarray(table[name], dtype=float) for name in ("azimuth_rad", "elevation_rad", "range_m")
    )
    from_east, from_north = plane.east_north_m(*at[:3])
    bearing, end = sights(azimuth, elevation, range_m, at)
    east_m, north_m = plane.east_north_m(*end)
    return {
        "from_east_m": from_east,
        "from_north_m": from_north,
        "bearing_rad": bearing,
        "elevation_rad": elevation,
        "range_m": range_m,
        "east_m": east_m,
        "north_m": north_m,
        "alt_m": end[2],
    }


def encounter_picture(path: Path) -> RunPicture:
    """Return the page's picture of a recorded encounter (``.daa``), the ownship first."""
    try:
        samples = read_daa_samples(path)
    except TrafficFileError as error:
        raise UsageError(str(error)) from error
    own, *others = samples
    first, last = (float(samples[own]["time"][end]) for end in (0, -1))
    plane = TangentPlane(float(samples[own]["lat"][0]), float(samples[own]["lon"][0]))
    picture = RunPicture(path.name, {"ownship": own}, last - first, first, targets=others)
    columns = []
    for number, table in enumerate(samples.values()):
        east, north = plane.east_north_m(table["lat"], table["lon"], table["alt"])
        track = np.unwrap(np.arctan2(table["ve"], table["vn"]))
        common = {"time_s": table["time"] - first, "east_m": east, "north_m": north}
        if number == 0:
            picture.tables["own"] = {**common, "alt_m": table["alt"], "heading_rad": track}
            continue
        target = np.full(len(east), number - 1)
        columns.append({**common, "alt_m": table["alt"], "target": target})
    if columns:
        picture.tables["truth"] = {
            name: np.concatenate([part[name] for part in columns]) for name in columns[0]
        }
    return picture
