"""Runs and recorded encounters as the page shows them: all in one plane and one time."""

import json
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from components.display.picture import LINE, TangentPlane, offset_positions, sights
from components.display.recorded_run import POSE, RecordedTables, read_table
from components.display.symbols import block_marks, in_colours, platform_colours
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
    """Return the page's picture of a run; `UsageError` where the folder holds none.

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
    whole, plane = _picture_of(run, info), _plane_of(_Poses(run, run.own_name))
    each = dict.fromkeys(run.carrying.values())
    whole.eyes = {on: _picture_of(run, info, on, plane) for on in each}
    return whole


def _picture_of(
    run: RecordedTables,
    info: dict[str, Any],
    platform: str | None = None,
    plane: TangentPlane | None = None,
) -> RunPicture:
    """Return the picture of a run, or of what a platform has of it, in the plane at its start."""
    folder, carrying, first = run.folder, run.carrying, platform or run.own_name
    if platform is not None:
        run = run.seen_from(platform)
    known = ("truth", "detections", "alerts")
    names = sorted({text for table in known for text in _texts(run, table, "target")})
    targets = {name: number for number, name in enumerate(names)}
    poses = _Poses(run, first)
    own_s, own = poses.of(None)
    plane = plane or _plane_of(poses)
    sensors = sorted(_texts(run, "scans", "block") | _texts(run, "detections", "block"))
    colours = platform_colours(carrying.values())
    marks = in_colours(block_marks(run.block_types(sensors)), carrying, colours)
    blocks = run.scene.get("blocks", {})
    picture = RunPicture(
        title=str(run.scene.get("title") or folder.name),
        facts=_run_facts(info, run.scene) | ({} if platform is None else {"seen from": platform}),
        duration_s=float(info["duration_s"]),
        sensors=[
            _sensor(name, blocks.get(name, {}), marks[name], carrying.get(name)) for name in sensors
        ],
        targets=names,
    )

    def plain(table: str, *columns: str) -> dict[str, AnyArray]:
        return {name: run.values(table, name) for name in columns if run.has(table, name)}

    def base_columns(table: str) -> dict[str, AnyArray]:
        result = {"target": _codes(run.texts(table, "target"), targets)}
        return result | _sources(run, table)

    tables = picture.tables
    tables["own"] = _ownship_columns(own_s, own, plane)
    if "truth" in run.tables:
        tables["truth"] = _truth(run, plane, targets)
    tables["scans"] = {
        "time_s": run.numbers("scans", "time_s"),
        "sensor": _codes(run.texts("scans", "block"), sensors),
        "detected": run.values("scans", "detected"),
    }
    tables["detections"] = {
        "time_s": run.numbers("detections", "time_s"),
        "sensor": _codes(run.texts("detections", "block"), sensors),
        "target": _codes(run.texts("detections", "target"), targets),
        "scan": run.values("detections", "scan"),
        **_lines_of_sight(run, "detections", run.stack_columns("detections", POSE), plane),
    }
    for name in ("fused", "tracks"):
        if run.has(name, "azimuth_rad"):
            time_s = run.numbers(name, "time_s")
            tables[name] = {
                **base_columns(name),
                **plain(name, "age_s"),
                "time_s": time_s,
                **_lines_of_sight(run, name, poses.at(name, time_s), plane),
            }
    if "tracks" in tables:
        picture.trackers = _blocks(run, "tracks")
    if "state_tracks" in run.tables:
        picture.trackers = _blocks(run, "state_tracks")
        tables["tracks"] = _estimates(run, picture.trackers, poses, plane)
    if "alerts" in run.tables:
        tables["alerts"] = {
            **base_columns("alerts"), "time_s": run.numbers("alerts", "time_s"),
            "level": run.values("alerts", "level"), **plain("alerts", *_LEVELS),
        }  # fmt: skip
        if run.has("alerts", "track"):
            tables["alerts"]["track"] = _track_numbers_of(run.values("alerts", "track"))
    if "manoeuvres" in run.tables:
        tables["manoeuvres"] = plain("manoeuvres", "time_s", "turn_rad", "climb_m")
    if "bands" in run.tables:
        columns = ("time_s", "low_rad", "high_rad", "low_m", "high_m")
        on = run.texts("bands", "platform") if run.has("bands", "platform") else [first]
        # They are drawn around who looks, so that those of others are left out.
        mine = np.array([one == first for one in on], dtype=bool)
        rows = np.flatnonzero(np.broadcast_to(mine, run.tables["bands"].num_rows))
        tables["bands"] = {name: run.numbers("bands", name)[rows] for name in columns}
        # Directions of bands are from the north of where the ownship then was.
        pose = _pose_at(own_s, own, tables["bands"]["time_s"])
        turned = np.nan_to_num(plane.turned_rad(pose))
        for name in ("low_rad", "high_rad"):
            tables["bands"][name] = tables["bands"][name] + turned
        tables["bands"]["region"] = _codes(run.texts("bands", "region"), BAND_REGIONS)[rows]
    return picture


def _json(path: Path) -> dict[str, Any]:
    try:
        result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path.parent}: holds no run: run.json: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f"{path}: is not JSON ({error})") from error
    return result


def _texts(run: RecordedTables, table: str, name: str) -> set[str]:
    """Return the texts of a column, none where there is no such column."""
    texts = run.texts(table, name) if run.has(table, name) else []
    return {text for text in texts if text is not None}


def _blocks(run: RecordedTables, table: str) -> list[str]:
    """Return the names of the blocks of a table, in the order of their numbers on the page."""
    return sorted(_texts(run, table, "block"))


def _codes(column: list[str | None], names: Any) -> AnyArray:
    """Return the number of each text among names, -1 for none."""
    known = names if isinstance(names, dict) else {name: i for i, name in enumerate(names)}
    codes = (_NO_TARGET if text is None else known.get(text, _NO_TARGET) for text in column)
    return np.fromiter(codes, dtype=np.int64, count=len(column))


def _sources(run: RecordedTables, table: str) -> dict[str, AnyArray]:
    """Return by number which block each row is of."""
    names = _blocks(run, table)
    return {"source": _codes(run.texts(table, "block"), names)} if names else {}


def _track_numbers_of(column: Any) -> AnyArray:
    """Return numbers of tracks, -1 where there is none."""
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


def _sensor(name: str, block: dict[str, Any], mark: Mark, on: str | None) -> dict[str, Any]:
    """Return how a sensor is shown, and its field of view as far as the scene says it.

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
    """Where the ownship was, and other platforms: poses (6, n) and their times, in order."""

    def __init__(self, run: RecordedTables, first: str | None) -> None:
        self._run, self._first = run, first
        self._known: dict[str | None, tuple[FloatArray, FloatArray]] = {}

    def of(self, platform: str | None) -> tuple[FloatArray, FloatArray]:
        """Return one's poses, the ownship's of None: the truth, or what it believed."""
        if platform not in self._known:
            self._known[platform] = self._read(platform)
        return self._known[platform]

    def _read(self, platform: str | None) -> tuple[FloatArray, FloatArray]:
        run, true = self._run, [name.removeprefix("own_") for name in POSE]
        if run.has("truth", *true):
            mine = np.array([name == platform for name in run.texts("truth", "target")], dtype=bool)
            if mine.any():
                return self._in_order("truth", true, np.flatnonzero(mine))
        rows = np.arange(run.tables["detections"].num_rows)
        if run.has("detections", "platform"):
            on = run.texts("detections", "platform")
            rows = np.flatnonzero(np.array([one == (platform or self._first) for one in on]))
        return self._in_order("detections", list(POSE), rows)

    def _in_order(
        self, table: str, names: list[str], rows: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        time_s, first = np.unique(self._run.numbers(table, "time_s")[rows], return_index=True)
        return time_s, self._run.stack_columns(table, names, rows[first])

    def at(self, table: str, time_s: FloatArray, rows: IntArray | None = None) -> FloatArray:
        """Return the latest poses, at some times, of what carries the blocks of a table's rows."""
        if not self._run.has(table, "platform"):
            return _pose_at(*self.of(None), time_s)
        on = np.array(self._run.texts(table, "platform"), dtype=object)
        on = on if rows is None else on[rows]
        result = np.full((len(POSE), len(time_s)), np.nan)
        for name in {*on.tolist()}:
            mine = np.flatnonzero(on == name)
            poses = self.of(None if name == self._first else name)
            result[:, mine] = _pose_at(*poses, time_s[mine])
        return result


def _plane_of(poses: _Poses) -> TangentPlane:
    """Return the plane at where the ownship begins."""
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
        "heading_rad": np.unwrap(own[3] + plane.turned_rad(own)) if len(east) else east,
    }


def _truth(
    run: RecordedTables, plane: TangentPlane, targets: Mapping[str, int]
) -> dict[str, AnyArray]:
    """Return the targets' true positions, by target and then by time."""
    code, time_s = _codes(run.texts("truth", "target"), targets), run.numbers("truth", "time_s")
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


def _estimates(
    run: RecordedTables,
    trackers: list[str],
    poses: "_Poses",
    plane: TangentPlane,
) -> dict[str, AnyArray]:
    """Return estimated states of tracks that live, along the plane's axes."""
    status = np.array(run.texts("state_tracks", "track_status"), dtype=object)
    keep = np.flatnonzero(status != "deleted")

    def column(name: str) -> FloatArray:
        return run.numbers("state_tracks", name)[keep]

    time_s = column("time_s")
    origin = run.stack_columns("state_tracks", ORIGIN, keep)
    ends = offset_positions(run.stack_columns("state_tracks", POSITION, keep), origin)
    east, north = plane.east_north_m(*ends)
    from_east, from_north = plane.east_north_m(*poses.at("state_tracks", time_s, keep)[:3])
    turned = plane.turned_rad(origin)
    c, s = np.cos(turned), np.sin(turned)
    v_north, v_east = column("north_m_s"), column("east_m_s")
    nn, ne, ee = (column(f"covariance_{k}_m2") for k in ("00", "01", "11"))
    return {
        "time_s": time_s,
        "number": np.asarray(run.values("state_tracks", "track"))[keep],
        **(
            {"source": _codes(run.texts("state_tracks", "block"), trackers)[keep]}
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


def _pose_at(own_s: FloatArray, own: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return the ownship's latest poses at some times, (6, n), NaN before the first."""
    row = np.searchsorted(own_s, time_s, side="right") - 1
    return np.stack([np.append(values, np.nan)[row] for values in own])


def _lines_of_sight(
    run: RecordedTables, table: str, pose: FloatArray, plane: TangentPlane
) -> dict[str, AnyArray]:
    """Return where measured lines of sight point, and where they end if they have a range.

    Bearings are from north; what is not known is NaN.
    """
    line = run.stack_columns(table, LINE)
    from_east, from_north = plane.east_north_m(*pose[:3])
    bearing, end = sights(line, pose)
    east_m, north_m = plane.east_north_m(*end)
    return {
        "from_east_m": from_east,
        "from_north_m": from_north,
        "bearing_rad": bearing + plane.turned_rad(pose),
        "elevation_rad": line[1],
        "range_m": line[2],
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
        turned = plane.turned_rad((table["lat"], table["lon"]))
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
