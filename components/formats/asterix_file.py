"""Read ASTERIX: system tracks and ADS-B reports as aircraft, plots of radars as detections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from components.formats.asterix_records import (
    ADS_B,
    DAY_S,
    PLOTS,
    SERVICE,
    SYSTEM_TRACKS,
    AsterixRecord,
    decode_records_with_notes,
)
from components.formats.recording import Recording
from components.formats.sample_columns import Altitude, SampleColumn, convert_to_enu_velocity
from components.formats.sample_table import SampleTable
from components.formats.text_rows import Problems, TrafficFileError
from components.geometry import enu_to_geodetic, radii_of_curvature, wrap_pi
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.files.input_files import InputFileError, read_input_bytes

_MOVES = ("vx", "vy", "vz")
#: Where a record's altitude stands: the measured flight level before the calculated one.
_HEIGHTS: Mapping[Altitude, tuple[str, ...]] = {
    "barometric": ("flight_level_m", "barometric_m"), "geometric": ("alt_m",),
}  # fmt: skip


@dataclass(frozen=True)
class RadarPlots:
    """The plots that radars reported, grouped by scan.

    Parameters
    ----------
    radars : list of str
        System area and identification code of each, ``"0/1"``.
    start_time_s : float
        The file's own time of its earliest record. All times count from there.
    scan_radar, scan_s : (scans,)
        Which radar, and when; a scan without a plot has one of these as well.
    own_lat_deg, own_lon_deg, own_alt_m : (scans,)
        Where the radar was, NaN where the file does not say.
    scan : (plots,)
        To which scan a plot belongs.
    time_s : (plots,)
    azimuth_rad, elevation_rad, range_m, range_rate_m_s : (plots,)
        Azimuth from north, (-pi, pi]; elevation NaN where no height was reported, or not from
        where; range rate NaN where none was.
    notes : list of str
    """

    radars: list[str]
    start_time_s: float
    scan_radar: IntArray
    scan_s: FloatArray
    own_lat_deg: FloatArray
    own_lon_deg: FloatArray
    own_alt_m: FloatArray
    scan: IntArray
    time_s: FloatArray
    azimuth_rad: FloatArray
    elevation_rad: FloatArray
    range_m: FloatArray
    range_rate_m_s: FloatArray
    notes: list[str]


def recording_of_asterix(
    problems: Problems,
    data: bytes,
    altitude: Altitude | None = None,
    ownship: str | None = None,
    of_day_s: float | None = None,
    least: int = 1,
    place: tuple[float, float, float] | None = None,
) -> Recording:
    """Return a `Recording` from ASTERIX data blocks: system tracks (062), ADS-B reports (021).

    Where there are none, those of radars' plots (048) that say whose they are, each by the radar
    that saw it first; `place` is where radars are that do not say it (latitude, longitude, m).

    The ownship is said by its identification, or as ``"SAC/SIC/number"`` where it has none; left
    out, it is the aircraft called ``OWNSHIP``, or else the first one. Heights are flight levels, of
    an aircraft that reports none its geometric height; with `altitude`, those of that kind alone.
    Times count from the day's midnight, or in UTC where an instant near the first record is known.
    """
    records, warnings = decode_records_with_notes(Path(problems.path), data)
    problems.of = "record"
    day_s = 0.0
    if of_day_s is not None and records:
        day_s = DAY_S * round((of_day_s - records[0].time_s) / DAY_S)
    names = _aircraft_names(records)
    if not names:
        records = _plots_as_reports(problems, records, place, warnings)
        names = _aircraft_names(records)
    kinds: list[Altitude] = ["barometric", "geometric"] if altitude is None else [altitude]
    heights = dict(zip(("alt", "alt instead"), kinds, strict=False))
    headers = ("time", "lat", "lon", *(f"{kind} altitude" for kind in kinds), *_MOVES)
    keys = ("time", "lat", "lon", *heights, *_MOVES)
    cells = {
        key: SampleColumn(k + 1, header, 1.0)
        for k, (key, header) in enumerate(zip(keys, headers, strict=True))
    }
    table = SampleTable(
        problems, ("name", *headers), 0, cells, optional=_MOVES, gaps=True,
        instead={} if altitude else {"alt": "alt instead"}, rows="records",
        least=least,
    )  # fmt: skip
    table.notes.warnings += warnings
    rows: dict[tuple[object, ...], dict[float, int]] = {}
    samples: dict[int, tuple[str, tuple[float, ...]]] = {}
    for k, record in enumerate(records):
        if record.category not in _AIRCRAFT:
            continue
        mine = rows.setdefault(_aircraft_key(record), {})
        sample = _time_position_velocity_of(record, kinds)
        if abs(sample[1]) > _POLE_DEG:
            problems.fail(
                f"category {record.category:03d}, a latitude of {sample[1]:.0f} degrees: it is of "
                "an old edition, which is not read, or damaged", line=k + 1,
            )  # fmt: skip
        before = mine.get(record.time_s)
        if before is not None and any(value != value for value in sample[1:4]):
            continue
        # Two records of one quantum of time are one instant: the later one counts.
        samples.pop(-1 if before is None else before, None)
        mine[record.time_s] = k
        samples[k] = names[_aircraft_key(record)], sample
    for k, (name, sample) in samples.items():
        table.add_numbers(k + 1, name, sample)
    if not names:
        problems.fail("there are no system tracks (062) and no ADS-B reports (021) in it")
    if ownship is None and _OWNSHIP in names.values():
        ownship = _OWNSHIP
    return table.recording(
        ownship,
        lambda columns: {**convert_to_enu_velocity(columns), "time": columns["time"] + day_s},
        kind="ASTERIX", units="the units of its items",
    )  # fmt: skip


def _plots_as_reports(
    problems: Problems,
    records: list[AsterixRecord],
    place: tuple[float, float, float] | None,
    warnings: list[str],
) -> list[AsterixRecord]:
    """Return radar plots that identify aircraft as ADS-B reports (by address) or system tracks."""
    plots = [one for one in records if one.category == PLOTS]
    named = [one for one in plots if {"number", "track", "code"} & one.values.keys()]
    seen = [
        one for one in named
        if "range_m" in one.values and {"alt_m", "flight_level_m"} & one.values.keys()
    ]  # fmt: skip
    if plots and not seen:
        problems.fail(
            f"none of its {len(plots)} plots of radars (048) says whose it is and how high: "
            "sensor.recorded takes them as detections"
        )
    places: dict[str, tuple[float, float, float]] = {}
    for one in records:
        if one.category == SERVICE and {"lat_deg", "lon_deg", "alt_m"} <= one.values.keys():
            lat_deg, lon_deg, alt_m = (one.values[name] for name in ("lat_deg", "lon_deg", "alt_m"))
            places.setdefault(_radar_code(one), (lat_deg, lon_deg, alt_m))
    first: dict[int, str] = {}
    kept, at = [], []
    for one in seen:
        values, source = dict(one.values), _radar_code(one)
        radar = places.get(source, place)
        if radar is None:
            problems.fail(
                f"radar {source}, whose plots (048) these are, does not say where it is (034, item "
                "120): place = { lat_deg, lon_deg, alt_m } of traffic.file says it, and "
                "sensor.recorded takes plots as detections"
            )
        category = ADS_B if "number" in values else SYSTEM_TRACKS
        if category == SYSTEM_TRACKS and "track" in values:
            values["number"] = values["track"]
        elif category == SYSTEM_TRACKS:  # beyond the numbers of tracks
            values |= {"number": 4096 + values["code"], "name": f"A{values['code']:04o}"}
        elif first.setdefault(values["number"], source) != source:
            continue
        high_m = values.get("flight_level_m", values.get("alt_m"))
        at.append((np.radians(values["azimuth_deg"]), values["range_m"], high_m, *radar))
        kept.append(AsterixRecord(category, one.time_s, values))
    azimuth, far_m, high, lat, lon, alt = np.array(at, float).reshape(-1, 6).T
    up = _elevation_to_height_rad(azimuth, far_m, high, lat, alt)
    level_m = far_m * np.cos(up)
    there = enu_to_geodetic(
        level_m * np.sin(azimuth), level_m * np.cos(azimuth), far_m * np.sin(up),
        reference_lat_deg=lat, reference_lon_deg=lon, reference_alt_m=alt,
    )  # fmt: skip
    reports = [
        one._replace(values={**one.values, "lat_deg": float(lat_deg), "lon_deg": float(lon_deg)})
        for one, lat_deg, lon_deg in zip(kept, *there[:2], strict=True)
    ]
    if len(reports) < len(plots):
        said = "do not say whose they are or how high, or are of aircraft that another radar sees"
        warnings.append(f"{len(plots) - len(reports)} plots are left out that {said}")
    return reports


_AIRCRAFT = (SYSTEM_TRACKS, ADS_B)
_POLE_DEG = 90.0
_OWNSHIP = "OWNSHIP"


def read_asterix_plots(
    path: str | PathLike[str],
    place: tuple[float, float, float] | None = None,
    data: bytes | None = None,
) -> RadarPlots:
    """Read the plots of radars (048) in an ASTERIX file, with their north markers (034).

    A plot belongs to its radar's last north marker; where a radar has none, plots of one time are
    a scan. Where a marker says no place, and before the first one, the radar is where its marker
    before, or its first, says. The elevation is that at which a height is met at the slant range,
    on the ellipsoid.

    Parameters
    ----------
    path : path-like
    place : (latitude, longitude, altitude), optional
        Where radars are of which the file does not say it: degrees, m above the ellipsoid.
    data : bytes, optional
        Its data blocks, where they are within something else.

    Returns
    -------
    RadarPlots

    Raises
    ------
    TrafficFileError
        It is no ASTERIX, or holds no plots.
    UsageError
        The extra ``asterix`` is not installed.
    """
    try:
        data = read_input_bytes(Path(path)) if data is None else data
    except InputFileError as error:
        raise TrafficFileError(str(path), [str(error)]) from None
    records, notes = decode_records_with_notes(Path(path), data)
    radars = sorted({_radar_code(r) for r in records if r.category == PLOTS})
    if not radars:
        raise TrafficFileError(str(path), ["there are no plots of a radar (048) in it"])
    start_s = min(record.time_s for record in records)
    code = {name: k for k, name in enumerate(radars)}
    marked = {_radar_code(r) for r in records if r.category == SERVICE}
    scans: list[tuple[int, float, float, float, float]] = []
    current: dict[str, int] = {}
    plots: list[tuple[float, ...]] = []
    # Out of order within a turn, as they are sent sector by sector.
    for record in sorted(records, key=lambda one: one.time_s):
        radar = _radar_code(record)
        if radar not in code or record.category not in (SERVICE, PLOTS):
            continue
        values, now_s = record.values, record.time_s - start_s
        if record.category == SERVICE and values.get("message") != 1:
            continue
        new = radar not in current or (radar not in marked and scans[current[radar]][1] != now_s)
        if record.category == SERVICE or new:
            at = (values.get(name, np.nan) for name in ("lat_deg", "lon_deg"))
            own_alt_m = values.get("alt_m", np.nan) if record.category == SERVICE else np.nan
            current[radar] = len(scans)
            scans.append((code[radar], now_s, *at, own_alt_m))
        if record.category == PLOTS and "range_m" in values:
            alt_m = values.get("alt_m", values.get("flight_level_m", np.nan))
            turned = np.radians(values["azimuth_deg"])
            rate_m_s = values.get("range_rate_m_s", np.nan)
            plots.append((current[radar], now_s, turned, alt_m, values["range_m"], rate_m_s))
    scan, time_s, azimuth, height, far_m, rate = np.array(plots).reshape(-1, 6).T
    radar_of, scan_s, *here = np.array(scans).T
    lat, lon, alt = _radar_positions(radar_of, np.array(here), place)
    of = scan.astype(np.int64)
    return RadarPlots(
        radars, start_s, radar_of.astype(np.int64), scan_s, lat, lon, alt, of, time_s,
        wrap_pi(azimuth), _elevation_to_height_rad(azimuth, far_m, height, lat[of], alt[of]),
        far_m, rate, notes,
    )  # fmt: skip


def _radar_positions(
    radar_of: FloatArray, said: FloatArray, place: tuple[float, float, float] | None
) -> FloatArray:
    """Return radar positions (3, scans); gaps take the last marker's, the first's, or ``place``."""
    filled = said.copy()
    for radar in np.unique(radar_of):
        mine = np.flatnonzero(radar_of == radar)
        known = mine[~np.isnan(said[:, mine]).any(axis=0)]
        if len(known):
            last = np.maximum(np.searchsorted(known, mine, side="right") - 1, 0)
            filled[:, mine] = said[:, known[last]]
        elif place is not None:
            filled[:, mine] = np.array(place)[:, np.newaxis]
    return filled


def _elevation_to_height_rad(
    azimuth_rad: FloatArray, far_m: FloatArray, to_m: FloatArray, lat_deg: FloatArray,
    from_m: FloatArray,
) -> FloatArray:  # fmt: skip
    """Return the elevation (rad) at which a line of a given slant range reaches a given height.

    The ellipsoid is taken as the sphere that touches it along the line (Euler's radius).
    """
    meridian, across = radii_of_curvature(lat_deg)
    north, east = np.cos(azimuth_rad) ** 2, np.sin(azimuth_rad) ** 2
    radius = 1.0 / (north / meridian + east / across) + from_m
    rise = to_m - from_m
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = (rise * (2.0 * radius + rise) - far_m**2) / (2.0 * radius * far_m)
    return np.arcsin(np.clip(sine, -1.0, 1.0))


def _radar_code(record: AsterixRecord) -> str:
    return f"{record.values.get('sac', 0)}/{record.values.get('sic', 0)}"


def _aircraft_key(record: AsterixRecord) -> tuple[object, ...]:
    """Return a key that all records of one aircraft in a file have in common."""
    if record.category == ADS_B and "number" in record.values:
        return ADS_B, record.values["number"]  # an address is one aircraft's, whoever received it
    return record.category, _radar_code(record), record.values.get("number", 0)


def _aircraft_names(records: list[AsterixRecord]) -> dict[tuple[object, ...], str]:
    """Return each aircraft key's name: its identification, numbered if aircraft share it."""
    said: dict[tuple[object, ...], str] = {}
    for record in records:
        if record.category in _AIRCRAFT and record.values.get("name"):
            said.setdefault(_aircraft_key(record), record.values["name"])
    named = list(said.values())
    result = {}
    for record in records:
        if record.category not in _AIRCRAFT or (key := _aircraft_key(record)) in result:
            continue
        number = f"{key[-1]:06X}" if key[0] == ADS_B else f"{_radar_code(record)}/{key[-1]}"
        name = said.get(key)
        result[key] = number if name is None else name if named.count(name) == 1 else (
            f"{name} {number}"
        )  # fmt: skip
    return result


def _time_position_velocity_of(
    record: AsterixRecord, kinds: Sequence[Altitude]
) -> tuple[float, ...]:
    """Return time, latitude, longitude, heights, east, north, up velocity; NaN if not recorded."""
    values = record.values
    items = [("lat_deg", "coarse_lat_deg"), ("lon_deg", "coarse_lon_deg")]
    position = [
        next((values[name] for name in names if name in values), np.nan)
        for names in (*items, *(_HEIGHTS[kind] for kind in kinds))
    ]
    east, north = values.get("velocity_east_m_s"), values.get("velocity_north_m_s")
    if "speed_m_s" in values and "track_deg" in values:
        track = np.radians(values["track_deg"])
        east, north = values["speed_m_s"] * np.sin(track), values["speed_m_s"] * np.cos(track)
    up = values.get("velocity_up_m_s", values.get("barometric_climb_m_s"))
    moves = (east, north, up) if None not in (east, north, up) else (np.nan,) * 3
    return record.time_s, *map(float, (*position, *moves))
