"""A run as CZML, Cesium's JSON: heights there are above the ellipsoid, as the run's are."""

import json
from typing import Any

import numpy as np

from components.display.recorded_run import RecordedTables
from components.export.globe_run import DETECTION_LASTS_S, Course, globe_run, iso_time


def czml_text(run: RecordedTables) -> str:
    """Return a CZML document: paths of aircraft and tracks, rings of alerts, detections as points.

    All is shown while it is there: aircraft while they fly, alerts while they are on,
    detections for `DETECTION_LASTS_S`.
    """
    shown = globe_run(run)
    packets: list[dict[str, Any]] = [
        {
            "id": "document",
            "name": shown.name,
            "version": "1.0",
            "clock": {
                "interval": f"{iso_time(0.0)}/{iso_time(shown.end_s)}",
                "currentTime": iso_time(0.0),
                "multiplier": 1,
            },
        }
    ]  # fmt: skip
    for one in shown.flights:
        packets.append(
            _moving_point(f"aircraft/{one.name}", one, 9, 2) | _label(one.name, one.colour)
        )
    for one in shown.tracks:
        packets.append(_moving_point(f"track/{one.name}", one, 6, 1) | _label(one.name, one.colour))
    for number, one in enumerate(shown.alerts):
        ring = {
            "pixelSize": 18, "color": {"rgba": [0, 0, 0, 0]},
            "outlineColor": {"rgba": _rgba(one.colour)}, "outlineWidth": 1 + min(one.level, 3),
        }  # fmt: skip
        words = _label(f"alert {one.level}", one.colour, below=True)
        packets.append(_course_packet(f"alert/{number}", one) | {"point": ring} | words)
    for number, seen in enumerate(shown.seen):
        packets.append(
            {
                "id": f"detection/{number}",
                "name": seen.name,
                "availability": f"{iso_time(seen.time_s)}/"
                f"{iso_time(seen.time_s + DETECTION_LASTS_S)}",
                "position": {"cartographicDegrees": list(seen.position)},
                "point": {
                    "pixelSize": 4, "color": {"rgba": _rgba(shown.marks[seen.sensor].colour)},
                },
            }
        )  # fmt: skip
    return json.dumps(packets, ensure_ascii=False, allow_nan=False, indent=0) + "\n"


def _course_packet(number: str, one: Course) -> dict[str, Any]:
    samples = np.column_stack([one.time_s, one.position]).ravel().tolist()
    return {
        "id": number,
        "name": one.name,
        "availability": f"{iso_time(one.time_s[0])}/{iso_time(one.time_s[-1])}",
        "position": {
            "epoch": iso_time(0.0),
            "cartographicDegrees": samples,
            "interpolationAlgorithm": "LINEAR",
        },
    }


def _moving_point(number: str, one: Course, size: int, width: int) -> dict[str, Any]:
    colour = {"rgba": _rgba(one.colour)}
    path = {"width": width, "leadTime": 0, "material": {"solidColor": {"color": colour}}}
    return _course_packet(number, one) | {
        "point": {"pixelSize": size, "color": colour},
        "path": path,
    }


def _label(text: str, colour: str, below: bool = False) -> dict[str, Any]:
    return {
        "label": {
            "text": text, "font": "14px sans-serif", "fillColor": {"rgba": _rgba(colour)},
            "horizontalOrigin": "LEFT", "pixelOffset": {"cartesian2": [12, 16 if below else 0]},
            "style": "FILL_AND_OUTLINE",
        }
    }  # fmt: skip


def _rgba(colour: str) -> list[int]:
    return [*(int(colour[i : i + 2], 16) for i in (1, 3, 5)), 255]
