"""A run as MCAP, in JSON with schemas: its tables, and flights and detections as viewers show them.

Schemas called ``foxglove.…`` are those of https://docs.foxglove.dev/docs/sdk/schemas, with the
fields that are used of them; viewers know them by their names. Second 0 is that of the globes.
"""

import io
import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from components.display.recorded_run import RecordedTables
from components.estimation.frame import pose_in_frame
from components.export.globe_run import (
    DETECTION_LASTS_S,
    START,
    DetectedPlace,
    detections_with_range,
    marks_of_blocks,
)
from components.geometry import line_of_sight_ned
from dsa_des.arrays.types import FloatArray
from dsa_des.errors.optional_libraries import import_extra

_NANO = 10**9
#: The frame of all that is drawn: east, north and up of where the first aircraft begins.
_FRAME = "map"
#: How large a detection is shown.
_SIZE_M = 60.0


def _json_object_schema(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _json_array_schema(**properties: Any) -> dict[str, Any]:
    return {"type": "array", "items": _json_object_schema(**properties)}


_NUMBER, _TEXT = {"type": "number"}, {"type": "string"}
_TIME = _json_object_schema(sec={"type": "integer"}, nsec={"type": "integer"})
_VECTOR = _json_object_schema(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POSE = _json_object_schema(
    position=_VECTOR, orientation=_json_object_schema(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
)
_COLOUR = _json_object_schema(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_FOXGLOVE = {
    "foxglove.LocationFix": _json_object_schema(
        timestamp=_TIME, frame_id=_TEXT, latitude=_NUMBER, longitude=_NUMBER, altitude=_NUMBER
    ),
    "foxglove.PoseInFrame": _json_object_schema(timestamp=_TIME, frame_id=_TEXT, pose=_POSE),
    "foxglove.SceneUpdate": _json_object_schema(
        deletions=_json_array_schema(timestamp=_TIME, type={"type": "integer"}, id=_TEXT),
        entities=_json_array_schema(
            timestamp=_TIME,
            frame_id=_TEXT,
            id=_TEXT,
            lifetime=_TIME,
            frame_locked={"type": "boolean"},
            metadata=_json_array_schema(key=_TEXT, value=_TEXT),
            spheres=_json_array_schema(pose=_POSE, size=_VECTOR, color=_COLOUR),
        ),
    ),
}


def mcap_bytes(run: RecordedTables) -> bytes:
    """Return a run as MCAP bytes: a topic for each table, two per aircraft, one for detections.

    ``/tables/NAME`` has the rows of a table, null where nothing stands; its schema says the units.
    ``/aircraft/NAME/location`` and ``/pose`` are the true flights, where they are recorded; axes of
    a pose are forward, left and up. ``/detections`` are drawn where they have a range.
    """
    writer_of = import_extra("mcap.writer", "mcap", "MCAP")
    stream = io.BytesIO()
    writer = writer_of.Writer(stream, compression=writer_of.CompressionType.NONE)
    writer.start(library="dsa_des")
    channels: dict[str, int] = {}
    schemas: dict[str, int] = {}

    def channel(topic: str, name: str, schema: dict[str, Any]) -> int:
        if topic not in channels:
            if name not in schemas:
                text = json.dumps({"title": name, **schema}, ensure_ascii=False).encode()
                schemas[name] = writer.register_schema(name, "jsonschema", text)
            channels[topic] = writer.register_channel(topic, "json", schemas[name])
        return channels[topic]

    messages: list[tuple[int, int, int, bytes]] = []
    for topic, name, schema, at_ns, content in (*_table_messages(run), *_scene_messages(run)):
        data = json.dumps(content, ensure_ascii=False, allow_nan=False).encode()
        messages.append((at_ns, channel(topic, name, schema), len(messages), data))
    messages.sort(key=lambda one: one[:3])
    for sequence, (at_ns, number, _, data) in enumerate(messages):
        writer.add_message(number, at_ns, data, at_ns, sequence)
    writer.finish()
    return stream.getvalue()


#: Topic, name of the schema, schema, instant (ns) and content.
_Message = tuple[str, str, dict[str, Any], int, dict[str, Any]]


def _table_messages(run: RecordedTables) -> Iterator[_Message]:
    for name, table in sorted(run.tables.items()):
        if "time_s" not in table.column_names:
            continue
        schema = _json_object_schema(
            **{field.name: _column_schema(field) for field in table.schema}
        )
        when = run.numbers(name, "time_s")
        run.refuse_large_values(name, {"time_s": when})
        for row, time_s in zip(table.to_pylist(), when.tolist(), strict=True):
            plain = {
                key: None if isinstance(value, float) and not math.isfinite(value) else value
                for key, value in row.items()
            }
            yield f"/tables/{name}", f"dsa_des.{name}", schema, _unix_time_ns(time_s), plain


def _column_schema(field: Any) -> dict[str, Any]:
    """Return the schema of a column: its type, its unit and frame, its meaning."""
    import pyarrow as pa

    kind = "string"
    if pa.types.is_boolean(field.type):
        kind = "boolean"
    elif pa.types.is_integer(field.type):
        kind = "integer"
    elif pa.types.is_floating(field.type):
        kind = "number"
    said = {k.decode(): v.decode() for k, v in (field.metadata or {}).items()}
    words = [said[key] for key in ("unit", "frame", "meaning") if said.get(key)]
    result: dict[str, Any] = {"type": [kind, "null"]}
    return result | ({"description": "; ".join(words)} if words else {})


def _scene_messages(run: RecordedTables) -> Iterator[_Message]:
    """Yield messages of true flights and detections, posed from the ownship's first position."""
    flights = run.true_flights() if "truth" in run.tables else {}
    origin: tuple[float, ...] | None = None
    for name, flight in flights.items():
        position = [flight[key] for key in ("lat_deg", "lon_deg", "alt_m")]
        origin = origin or tuple(float(part[0]) for part in position)
        attitude = [flight[f"{angle}_rad"] for angle in ("heading", "pitch", "roll")]
        turned = _orientations(origin, position, attitude)
        poses = zip(_offsets(origin, *position), turned, strict=True)
        rows = zip(flight["time_s"].tolist(), *(part.tolist() for part in position), strict=True)
        for (time_s, lat, lon, alt), (offset, turn) in zip(rows, poses, strict=True):
            when = _unix_time_ns(time_s)
            fix = {
                "timestamp": _stamp(when), "frame_id": name,
                "latitude": lat, "longitude": lon, "altitude": alt,
            }  # fmt: skip
            yield _message(f"/aircraft/{name}/location", "foxglove.LocationFix", when, fix)
            pose = {"timestamp": _stamp(when), "frame_id": _FRAME,
                    "pose": {"position": offset, "orientation": turn}}  # fmt: skip
            yield _message(f"/aircraft/{name}/pose", "foxglove.PoseInFrame", when, pose)
    ends = list(detections_with_range(run))
    if not ends:
        return
    lon, lat, alt = np.array([end.position for end in ends]).T
    origin = origin or (float(lat[0]), float(lon[0]), float(alt[0]))
    marks = marks_of_blocks(run, {end.sensor for end in ends})
    for number, (end, offset) in enumerate(zip(ends, _offsets(origin, lat, lon, alt), strict=True)):
        ball = _detection_time_and_sphere(number, end, offset, marks[end.sensor].colour)
        yield _message("/detections", "foxglove.SceneUpdate", *ball)


def _message(topic: str, name: str, at_ns: int, content: dict[str, Any]) -> _Message:
    return topic, name, _FOXGLOVE[name], at_ns, content


def _detection_time_and_sphere(
    number: int, end: DetectedPlace, offset: dict[str, float], painted: str
) -> tuple[int, dict[str, Any]]:
    when = _unix_time_ns(end.time_s)
    colour = [int(painted[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    sphere = {
        "pose": {"position": offset, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}},
        "size": dict.fromkeys("xyz", _SIZE_M),
        "color": dict(zip("rgba", (*colour, 1.0), strict=True)),
    }
    entity = {
        "timestamp": _stamp(when), "frame_id": _FRAME, "id": f"detection/{number}",
        "lifetime": {"sec": int(DETECTION_LASTS_S), "nsec": 0}, "frame_locked": False,
        "metadata": [
            {"key": "sensor", "value": end.sensor}, {"key": "target", "value": end.target}
        ],
        "spheres": [sphere],
    }  # fmt: skip
    return when, {"deletions": [], "entities": [entity]}


def _offsets(
    origin: tuple[float, ...], lat: FloatArray, lon: FloatArray, alt: FloatArray
) -> list[dict[str, float]]:
    north, east, down = line_of_sight_ned(origin[0], origin[1], origin[2], lat, lon, alt)
    parts = zip(east.tolist(), north.tolist(), (-down).tolist(), strict=True)
    return [dict(zip("xyz", part, strict=True)) for part in parts]


def _orientations(
    origin: tuple[float, ...], position: list[FloatArray], attitude_rad: list[FloatArray]
) -> list[dict[str, float]]:
    """Return quaternions (x, y, z, w) from body axes (forward, left, up) to east, north, up."""
    from scipy.spatial.transform import Rotation

    here = np.array([np.full(len(position[0]), value) for value in origin])
    pose = pose_in_frame(here, np.array(position), np.array(attitude_rad))
    # Rows are nose, right wing and floor along north, east and down of the origin.
    nose, right, floor = pose.to_body[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])[:, np.newaxis]
    turned = Rotation.from_matrix(np.stack([nose, -right, -floor]).transpose(2, 1, 0))
    return [dict(zip("xyzw", row, strict=True)) for row in turned.as_quat().tolist()]


def _unix_time_ns(time_s: float) -> int:
    return int(START.timestamp()) * _NANO + round(time_s * _NANO)


def _stamp(at_ns: int) -> dict[str, int]:
    return dict(zip(("sec", "nsec"), divmod(at_ns, _NANO), strict=True))
