"""Runs and recorded encounters as the page shows them: all in one plane and one time."""

import json
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from components.display.picture_plane import (
    LINE,
    TangentPlane,
    bearings_and_end_points,
    geodetic_from_ned_offsets,
)
from components.display.recorded_run import POSE, RecordedTables, read_table
from components.display.symbols import block_marks, platform_colours, recolour_by_platform
from components.formats.daa_file import read_daa_samples
from components.formats.text_rows import TrafficFileError
from components.messages.alerts import BAND_REGIONS
from components.messages.columns import ORIGIN, POSITION
from components.view.page import RunPicture
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.block.mark import Mark
from dsa_des.errors import UsageError

_NO_TARGET, _NOWHERE = -1, TangentPlane(0.0, 0.0)
#: What the page shows of a run; the first two are in every run.
_TABLES = (
    "detections", "scans", "truth", "fused", "tracks", "state_tracks", "alerts", "manoeuvres",
    "bands",
)  # fmt: skip
_LEVELS = tuple(f"time_to_level_{level}_s" for level in (1, 2, 3, 4))


def run_picture(folder: Path, platform: str | None = None) -> RunPicture:
    """Return what the page shows of a run (all or one platform); UsageError if no run is there.

    It is what all platforms have, with what each of several has as seen from there, or what one
    has.
    """
    info = _json(folder / "run.json")
    if "duration_s" not in info:
        raise UsageError(f"{folder}: holds no run: run.json has no duration_s")
    paths = {name: folder / f"{name}.parquet" for name in _TABLES}
    if not all(paths[name].is_file() for name in _TABLES[:2]):
        raise UsageError(f"{folder}: holds no run: scans.parquet or detections.parquet is missing")
    run = RecordedTables(
        folder, {n: read_table(path) for n, path in paths.items() if path.is_file()}
    )
    if platform is not None:
        return _picture_of(run, info, platform)
    whole, plane = _picture_of(run, info), _plane_at_start(_Poses(run, run.own_name))
    each = dict.fromkeys(run.platform_by_block.values())
    whole.eyes = {on: _picture_of(run, info, on, plane) for on in each}
    return whole


def _picture_of(
    run: RecordedTables,
    info: dict[str, Any],
    platform: str | None = None,
    plane: TangentPlane | None = None,
) -> RunPicture:
    """Return what the page shows of a run or one platform, in a plane tangent at the start."""
    folder, carrying, first = run.folder, run.platform_by_block, platform or run.own_name
    if platform is not None:
        run = run.seen_from(platform)
    known = ("truth", "detections", "alerts")
    names = sorted({text for table in known for text in _distinct_texts(run, table, "target")})
    targets = {name: number for number, name in enumerate(names)}
    poses = _Poses(run, first)
    own_s, own = poses.of(None)
    plane = plane or _plane_at_start(poses)
    sensors = sorted(
        _distinct_texts(run, "scans", "block") | _distinct_texts(run, "detections", "block")
    )
    colours = platform_colours(carrying.values())
    marks = recolour_by_platform(block_marks(run.block_types(sensors)), carrying, colours)
    blocks = run.scene.get("blocks", {})
    picture = RunPicture(
        title=str(run.scene.get("title") or folder.name),
        facts=_run_facts(info, run.scene) | ({} if platform is None else {"seen from": platform}),
        duration_s=float(info["duration_s"]),
        sensors=[
            _sensor_entry(name, blocks.get(name, {}), marks[name], carrying.get(name))
            for name in sensors
        ],
        targets=names,
    )

    def plain(table: str, *columns: str) -> dict[str, AnyArray]:
        return {name: run.values(table, name) for name in columns if run.has_columns(table, name)}

    def base_columns(table: str) -> dict[str, AnyArray]:
        result = {"target": _index_of_names(run.texts(table, "target"), targets)}
        return result | _source_columns(run, table)

    tables = picture.tables
    tables["own"] = _ownship_columns(own_s, own, plane)
    if "truth" in run.tables:
        tables["truth"] = _true_target_positions(run, plane, targets)
    tables["scans"] = {
        "time_s": run.numbers("scans", "time_s"),
        "sensor": _index_of_names(run.texts("scans", "block"), sensors),
        "detected": run.values("scans", "detected"),
    }
    tables["detections"] = {
        "time_s": run.numbers("detections", "time_s"),
        "sensor": _index_of_names(run.texts("detections", "block"), sensors),
        "target": _index_of_names(run.texts("detections", "target"), targets),
        "scan": run.values("detections", "scan"),
        **_line_of_sight_columns(run, "detections", run.stack_columns("detections", POSE), plane),
    }
    for name in ("fused", "tracks"):
        if run.has_columns(name, "azimuth_rad"):
            time_s = run.numbers(name, "time_s")
            tables[name] = {
                **base_columns(name),
                **plain(name, "age_s"),
                "time_s": time_s,
                **_line_of_sight_columns(run, name, poses.at(name, time_s), plane),
            }
    if "tracks" in tables:
        picture.trackers = _block_names(run, "tracks")
    if "state_tracks" in run.tables:
        picture.trackers = _block_names(run, "state_tracks")
        tables["tracks"] = _track_estimate_columns(run, picture.trackers, poses, plane)
    if "alerts" in run.tables:
        tables["alerts"] = {
            **base_columns("alerts"), "time_s": run.numbers("alerts", "time_s"),
            "level": run.values("alerts", "level"), **plain("alerts", *_LEVELS),
        }  # fmt: skip
        if run.has_columns("alerts", "track"):
            tables["alerts"]["track"] = _track_numbers_of(run.values("alerts", "track"))
    if "manoeuvres" in run.tables:
        tables["manoeuvres"] = plain("manoeuvres", "time_s", "turn_rad", "climb_m")
    if "bands" in run.tables:
        columns = ("time_s", "low_rad", "high_rad", "low_m", "high_m")
        on = run.texts("bands", "platform") if run.has_columns("bands", "platform") else [first]
        # They are drawn around who looks, so that those of others are left out.
        mine = np.array([one == first for one in on], dtype=bool)
        rows = np.flatnonzero(np.broadcast_to(mine, run.tables["bands"].num_rows))
        tables["bands"] = {name: run.numbers("bands", name)[rows] for name in columns}
        # Directions of bands are from the north of where the ownship then was.
        pose = _latest_pose_at(own_s, own, tables["bands"]["time_s"])
        turned = np.nan_to_num(plane.north_direction_rad(pose))
        for name in ("low_rad", "high_rad"):
            tables["bands"][name] = tables["bands"][name] + turned
        tables["bands"]["region"] = _index_of_names(run.texts("bands", "region"), BAND_REGIONS)[
            rows
        ]
    return picture


def _json(path: Path) -> dict[str, Any]:
    try:
        result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path.parent}: holds no run: run.json: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f"{path}: is not JSON ({error})") from error
    return result


def _distinct_texts(run: RecordedTables, table: str, name: str) -> set[str]:
    """Return the distinct texts in a column of a table; empty if there is no such column."""
    texts = run.texts(table, name) if run.has_columns(table, name) else []
    return {text for text in texts if text is not None}


def _block_names(run: RecordedTables, table: str) -> list[str]:
    """Return the names of a table's blocks, sorted; the page uses their index as number."""
    return sorted(_distinct_texts(run, table, "block"))


def _index_of_names(column: list[str | None], names: Any) -> AnyArray:
    """Return the index of each text among names, -1 if it is none of them."""
    known = names if isinstance(names, dict) else {name: i for i, name in enumerate(names)}
    codes = (_NO_TARGET if text is None else known.get(text, _NO_TARGET) for text in column)
    return np.fromiter(codes, dtype=np.int64, count=len(column))


def _source_columns(run: RecordedTables, table: str) -> dict[str, AnyArray]:
    """Return column ``source``: each row's block as index among the table's; empty if none."""
    names = _block_names(run, table)
    return {"source": _index_of_names(run.texts(table, "block"), names)} if names else {}


def _track_numbers_of(column: Any) -> AnyArray:
    """Return the track number of each row, -1 where a row has no track."""
    numbers = np.asarray(column, dtype=float)
    return np.where(np.isfinite(numbers), numbers, _NO_TARGET).astype(np.int64)


def _run_facts(info: dict[str, Any], scene: dict[str, Any]) -> dict[str, Any]:
    facts = {"seed": info.get("seed"), "scene": str(info.get("scene_sha256", ""))[:12]}
    versions = info.get("versions")
    if isinstance(versions, dict):
        facts["version"] = versions.get("dsa-des") or versions.get("dsa_des")
    if scene.get("description"):
        facts["description"] = str(scene["description"])
    return {name: value for name, value in facts.items() if value not in (None, "")}


def _sensor_entry(name: str, block: dict[str, Any], mark: Mark, on: str | None) -> dict[str, Any]:
    """Return a sensor's page entry: name, colour, marker, and field of view as far as stated.

    `on` is what carries it, where there are several: about that it is drawn.
    """
    result: dict[str, Any] = {"name": name, "colour": mark.colour, "marker": mark.marker}
    if on is not None:
        result["on"] = on
    limits = block.get("azimuth_deg")
    if isinstance(limits, list) and len(limits) == 2:
        turned = float(block.get("mount_azimuth_deg", 0.0))
        result["azimuth_deg"] = [float(edge) + turned for edge in limits]
    if block.get("beam_sweep") is True and "azimuth_deg" in result:
        rate = Fraction(str(block["scan_rate_hz"])) * (
            1 + Fraction(str(block.get("rate_error_ppm", 0))) / 10**6
        )
        result["sweep_s"] = float(1 / rate)
    if isinstance(block.get("range_km"), int | float):
        result["range_m"] = 1000.0 * block["range_km"]
    return result


class _Poses:
    """True or believed poses (6, n) of ownship and other platforms, with times in order."""

    def __init__(self, run: RecordedTables, first: str | None) -> None:
        self._run, self._first = run, first
        self._known: dict[str | None, tuple[FloatArray, FloatArray]] = {}

    def of(self, platform: str | None) -> tuple[FloatArray, FloatArray]:
        """Return times and poses (6, n), true if recorded, else believed; None: the ownship's."""
        if platform not in self._known:
            self._known[platform] = self._read(platform)
        return self._known[platform]

    def _read(self, platform: str | None) -> tuple[FloatArray, FloatArray]:
        run, true = self._run, [name.removeprefix("own_") for name in POSE]
        if run.has_columns("truth", *true):
            mine = np.array([name == platform for name in run.texts("truth", "target")], dtype=bool)
            if mine.any():
                return self._in_order("truth", true, np.flatnonzero(mine))
        rows = np.arange(run.tables["detections"].num_rows)
        if run.has_columns("detections", "platform"):
            on = run.texts("detections", "platform")
            rows = np.flatnonzero(np.array([one == (platform or self._first) for one in on]))
        return self._in_order("detections", list(POSE), rows)

    def _in_order(
        self, table: str, names: list[str], rows: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        time_s, first = np.unique(self._run.numbers(table, "time_s")[rows], return_index=True)
        return time_s, self._run.stack_columns(table, names, rows[first])

    def at(self, table: str, time_s: FloatArray, rows: IntArray | None = None) -> FloatArray:
        """Return for each row and its time its block's platform's latest pose, (6, n)."""
        if not self._run.has_columns(table, "platform"):
            return _latest_pose_at(*self.of(None), time_s)
        on = np.array(self._run.texts(table, "platform"), dtype=object)
        on = on if rows is None else on[rows]
        result = np.full((len(POSE), len(time_s)), np.nan)
        for name in {*on.tolist()}:
            mine = np.flatnonzero(on == name)
            poses = self.of(None if name == self._first else name)
            result[:, mine] = _latest_pose_at(*poses, time_s[mine])
        return result


def _plane_at_start(poses: _Poses) -> TangentPlane:
    """Return the tangent plane at the ownship's first position."""
    _, own = poses.of(None)
    return TangentPlane(float(own[0, 0]), float(own[1, 0])) if own.shape[1] else _NOWHERE


def _ownship_columns(
    time_s: FloatArray, own: FloatArray, plane: TangentPlane
) -> dict[str, AnyArray]:
    east, north = plane.east_north_m(*own[:3])
    return {
        "time_s": time_s,
        "east_m": east,
        "north_m": north,
        "alt_m": own[2],
        "heading_rad": np.unwrap(own[3] + plane.north_direction_rad(own)) if len(east) else east,
    }


def _true_target_positions(
    run: RecordedTables, plane: TangentPlane, targets: Mapping[str, int]
) -> dict[str, AnyArray]:
    """Return the true positions of the targets in the plane, sorted by target and then by time."""
    code, time_s = (
        _index_of_names(run.texts("truth", "target"), targets),
        run.numbers("truth", "time_s"),
    )
    keep = np.flatnonzero((code >= 0) & np.isfinite(run.numbers("truth", "lat_deg")))
    keep = keep[np.lexsort((time_s[keep], code[keep]))]
    position = [run.values("truth", name)[keep] for name in ("lat_deg", "lon_deg", "alt_m")]
    east, north = plane.east_north_m(*position)
    return {
        "time_s": time_s[keep],
        "target": code[keep],
        "east_m": east,
        "north_m": north,
        "alt_m": position[2],
    }


def _track_estimate_columns(
    run: RecordedTables,
    trackers: list[str],
    poses: "_Poses",
    plane: TangentPlane,
) -> dict[str, AnyArray]:
    """Return estimated positions and velocities of tracks not deleted, along the plane's axes."""
    status = np.array(run.texts("state_tracks", "track_status"), dtype=object)
    keep = np.flatnonzero(status != "deleted")

    def column(name: str) -> FloatArray:
        return run.numbers("state_tracks", name)[keep]

    time_s = column("time_s")
    origin = run.stack_columns("state_tracks", ORIGIN, keep)
    ends = geodetic_from_ned_offsets(run.stack_columns("state_tracks", POSITION, keep), origin)
    east, north = plane.east_north_m(*ends)
    from_east, from_north = plane.east_north_m(*poses.at("state_tracks", time_s, keep)[:3])
    turned = plane.north_direction_rad(origin)
    c, s = np.cos(turned), np.sin(turned)
    v_north, v_east = column("north_m_s"), column("east_m_s")
    nn, ne, ee = (column(f"covariance_{k}_m2") for k in ("00", "01", "11"))
    return {
        "time_s": time_s,
        "number": np.asarray(run.values("state_tracks", "track"))[keep],
        **(
            {"source": _index_of_names(run.texts("state_tracks", "block"), trackers)[keep]}
            if trackers
            else {}
        ),
        "tentative": status[keep] == "tentative",
        "from_east_m": from_east,
        "from_north_m": from_north,
        "bearing_rad": column("azimuth_rad") + turned,
        "east_m": east,
        "north_m": north,
        "alt_m": ends[2],
        "east_mps": s * v_north + c * v_east,
        "north_mps": c * v_north - s * v_east,
        "variance_north_m2": c * c * nn - 2.0 * s * c * ne + s * s * ee,
        "covariance_m2": s * c * (nn - ee) + (c * c - s * s) * ne,
        "variance_east_m2": s * s * nn + 2.0 * s * c * ne + c * c * ee,
    }


def _latest_pose_at(own_s: FloatArray, own: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return the latest pose at or before each time, (6, n); NaN before the first."""
    row = np.searchsorted(own_s, time_s, side="right") - 1
    return np.stack([np.append(values, np.nan)[row] for values in own])


def _line_of_sight_columns(
    run: RecordedTables, table: str, pose: FloatArray, plane: TangentPlane
) -> dict[str, AnyArray]:
    """Return sight lines' columns: origin, bearing, elevation, range, end points; NaN if unknown.

    Bearings are from north; what is not known is NaN.
    """
    line = run.stack_columns(table, LINE)
    from_east, from_north = plane.east_north_m(*pose[:3])
    bearing, end = bearings_and_end_points(line, pose)
    east_m, north_m = plane.east_north_m(*end)
    return {
        "from_east_m": from_east,
        "from_north_m": from_north,
        "bearing_rad": bearing + plane.north_direction_rad(pose),
        "elevation_rad": line[1],
        "range_m": line[2],
        "east_m": east_m,
        "north_m": north_m,
        "alt_m": end[2],
    }


def encounter_picture(path: Path) -> RunPicture:
    """Return what the page shows of a ``.daa`` encounter; its first aircraft is the ownship."""
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
        turned = plane.north_direction_rad((table["lat"], table["lon"]))
        track = np.unwrap(np.arctan2(table["ve"], table["vn"]) + turned)
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
