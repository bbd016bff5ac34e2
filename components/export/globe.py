"""Flights and detections for globes: KML (OGC 07-147r2 with Google's tracks) and CZML."""

import json
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from components.display.picture import sights
from components.display.recorded_run import OWNSHIP, RecordedTables
from components.sensor.marks import FUSION, RADAR
from dsa_des.arrays.types import FloatArray
from dsa_des.text.safe_text import printable

#: A run has no date; its second 0 is put here.
START = datetime(2000, 1, 1, tzinfo=UTC)
_POSE = ("own_lat_deg", "own_lon_deg", "own_alt_m", "own_heading_rad", "own_pitch_rad",
         "own_roll_rad")  # fmt: skip


def _when(time_s: float) -> str:
    moment = START + timedelta(microseconds=round(1e6 * time_s))
    return moment.isoformat().replace("+00:00", "Z")


def detected(run: RecordedTables) -> Iterator[tuple[str, str, float, float, float, float]]:
    """Give sensor, target, time, longitude, latitude and height of detections with a range."""
    if "detections" not in run.tables:
        return
    number: dict[str, FloatArray] = {
        name: run.numbers("detections", name)
        for name in ("time_s", "azimuth_rad", "elevation_rad", "range_m", *_POSE)
    }
    there = np.flatnonzero(~np.isnan(list(number.values())).any(axis=0))
    run.refuse_large("detections", {n: np.where(np.isnan(v), 0.0, v) for n, v in number.items()})
    if len(there) == 0:
        return
    number = {name: values[there] for name, values in number.items()}
    directions = number["azimuth_rad"], number["elevation_rad"], number["range_m"]
    _, (lat, lon, alt) = sights(*directions, [number[name] for name in _POSE])
    sensors, targets = (run.texts("detections", name) for name in ("block", "target"))
    places = zip(lon.tolist(), lat.tolist(), alt.tolist(), strict=True)
    for row, time_s, place in zip(there.tolist(), number["time_s"].tolist(), places, strict=True):
        yield sensors[row] or "", targets[row] or "", time_s, *place


def kml_text(run: RecordedTables) -> str:
    """Return a KML document: a track for each aircraft, a point for each detection with a range."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        "<Document>",
        f"<name>{_xml(run.folder.resolve().name)}</name>",
    ]
    for name, flight in run.flights().items():
        lines += [
            f"<Placemark><name>{_xml(name)}</name><gx:Track>",
            "<altitudeMode>absolute</altitudeMode>",
            *(f"<when>{_when(t)}</when>" for t in flight["time_s"].tolist()),
        ]
        columns = (flight[key].tolist() for key in ("lon_deg", "lat_deg", "alt_m"))
        lines += [f"<gx:coord>{x} {y} {z}</gx:coord>" for x, y, z in zip(*columns, strict=True)]
        lines.append("</gx:Track></Placemark>")
    for sensor, target, time_s, lon, lat, alt in detected(run):
        lines += [
            f"<Placemark><name>{_xml(f'{sensor} {target}'.strip())}</name>",
            f"<TimeStamp><when>{_when(time_s)}</when></TimeStamp><Point>",
            f"<altitudeMode>absolute</altitudeMode><coordinates>{lon},{lat},{alt}</coordinates>",
            "</Point></Placemark>",
        ]
    return "\n".join([*lines, "</Document>", "</kml>", ""])


def _xml(text: str) -> str:
    return escape(printable(text))


def czml_text(run: RecordedTables) -> str:
    """Return a CZML document: a path for each aircraft, a point for each detection with a range."""
    flights = run.flights()
    end_s = max(float(flight["time_s"][-1]) for flight in flights.values())
    packets: list[dict[str, Any]] = [
        {
            "id": "document",
            "name": run.folder.resolve().name,
            "version": "1.0",
            "clock": {"interval": f"{_when(0.0)}/{_when(end_s)}", "currentTime": _when(0.0)},
        }
    ]
    for name, flight in flights.items():
        keys = ("time_s", "lon_deg", "lat_deg", "alt_m")
        samples = np.stack([flight[key] for key in keys], axis=1)
        colour = FUSION.colour if name == OWNSHIP else RADAR.colour
        packets.append(
            {
                "id": f"aircraft/{name}",
                "name": name,
                "label": {"text": name},
                "position": {
                    "epoch": _when(0.0),
                    "cartographicDegrees": samples.ravel().tolist(),
                    "interpolationAlgorithm": "LINEAR",
                },
                "point": {"pixelSize": 9, "color": {"rgba": _rgba(colour)}},
                "path": {"width": 1},
            }
        )
    for number, (sensor, target, time_s, lon, lat, alt) in enumerate(detected(run)):
        packets.append(
            {
                "id": f"detection/{number}",
                "name": f"{sensor} {target}".strip(),
                "availability": f"{_when(time_s)}/{_when(time_s + 4.0)}",
                "position": {"cartographicDegrees": [lon, lat, alt]},
                "point": {"pixelSize": 4, "color": {"rgba": _rgba(RADAR.colour)}},
            }
        )
    return json.dumps(packets, ensure_ascii=False, allow_nan=False, indent=0) + "\n"


def _rgba(colour: str) -> list[int]:
    return [*(int(colour[i : i + 2], 16) for i in (1, 3, 5)), 255]
