"""Planes as a host program describes them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from components.aircraft.aircraft import Aircraft
from components.embedding.host_traffic import Plane
from components.embedding.states import to_numbers
from dsa_des.arrays.types import FloatArray
from dsa_des.errors import Problem, SceneError, did_you_mean
from dsa_des.scene.examples import find_input_file
from dsa_des.scene.parameter_errors import explain_validation_error
from dsa_des.scene.scene_file import SceneFile, merge_tables_in_place, read_scene_file

_CALL = "add_plane"


def make_plane(name: str, aircraft: object, values: Mapping[str, Any]) -> Plane:
    """Return a checked plane with this name, from an aircraft type and keys that override it.

    Parameters
    ----------
    name : str
    aircraft : path, Aircraft, mapping or None
        A file, the name of one that is shipped (``f_16``), or its keys.
    values : mapping
        Keys of `Aircraft` that override those of `aircraft`, table by table.

    Raises
    ------
    SceneError
        With every problem: an unknown key with the nearest known one, a value out of range.
    """
    described = SceneFile(Path(_CALL), {})
    if isinstance(aircraft, str | Path):
        described = read_scene_file(find_input_file(aircraft))
        # A file may say how an obstacle stays in place: here the host says where it is.
        _remove_flight_keys(described.data)
    elif isinstance(aircraft, Aircraft):
        fields = Aircraft.model_fields
        described.data = {key: getattr(aircraft, key) for key in fields}
        # Tables are models already; what overrides them does so key by key.
        described.data |= {key: getattr(aircraft, key).model_dump() for key in ("eo", "ir")}
    elif isinstance(aircraft, Mapping):
        merge_tables_in_place(described.data, aircraft)
    elif aircraft is not None:
        message = "must be a file, an Aircraft or a mapping of its keys"
        raise SceneError([Problem(_CALL, "aircraft", message, aircraft)])
    given = {key: value for key, value in values.items() if value is not None}
    merge_tables_in_place(described.data, given)
    described.sources.update({(key,): _CALL for key in ("name", *given)})
    described.data["name"] = name
    try:
        return Plane.model_validate(described.data)
    except ValidationError as error:
        raise SceneError(
            explain_validation_error(described, (), "an aircraft", Plane, error)
        ) from error


def _remove_flight_keys(data: dict[str, Any]) -> None:
    from components.traffic.scripted import Flight

    for key in Flight.model_fields:
        data.pop(key, None)


class FixedPath:
    """Positions and attitudes of a plane the host does not move: one, or one from each time on.

    Parameters
    ----------
    lla : (3,) or (times, 3) array_like
        Latitude and longitude in rad, altitude in m.
    att : (3,) or (times, 3) array_like
        Yaw, pitch and roll in rad.
    times_s : (times,) array_like, optional
        When each row begins to hold; it holds until the next one. Needed for more than one row.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, or the times are not ascending.
    """

    def __init__(self, lla: ArrayLike, att: ArrayLike, times_s: ArrayLike | None) -> None:
        position, attitude = (
            _check_rows_of_three("position", lla),
            _check_rows_of_three("orientation", att),
        )
        count = max(len(position), len(attitude))
        for label, rows in (("position", position), ("orientation", attitude)):
            if len(rows) not in (1, count):
                raise ValueError(f"{label} has {len(rows)} rows: it must have 1 or {count}")
        times = np.zeros(1) if times_s is None else to_numbers("times_s", times_s)
        if times.shape != (count,) and not (times_s is None and count == 1):
            shown = "missing" if times_s is None else f"of shape {times.shape}"
            raise ValueError(f"times_s is {shown}: it must give one time for each of {count} rows")
        if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise ValueError("times_s must be finite and ascending")
        # A row begins where adding up steps in floats may have begun it.
        self._times = times - 16.0 * np.arange(count) * np.spacing(np.abs(times))
        self._rows = np.hstack(
            [np.broadcast_to(position, (count, 3)), np.broadcast_to(attitude, (count, 3))]
        )

    def at(self, time_s: float) -> FloatArray:
        """Return lat, lon (rad), alt (m), yaw, pitch, roll (rad) at a time; NaN before any time."""
        row = int(np.searchsorted(self._times, time_s, side="right")) - 1
        if len(self._times) == 1:
            row = 0
        state: FloatArray = self._rows[row] if row >= 0 else np.full(6, np.nan)
        return state


def _check_rows_of_three(label: str, value: ArrayLike) -> FloatArray:
    rows = np.atleast_2d(to_numbers(label, value))
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"{label} has the shape {np.shape(value)}: it must be (3,) or (times, 3)")
    if not np.isfinite(rows).all():
        raise ValueError(f"{label} must be finite")
    return rows


def plane_index(plane: str | int, names: tuple[str, ...]) -> int:
    """Return the index of a plane, given its name or its index; ValueError if there is none."""
    if isinstance(plane, str):
        if plane not in names:
            raise ValueError(f"there is no plane {plane!r}{did_you_mean(plane, names)}")
        return names.index(plane)
    number = int(plane)
    if not 0 <= number < len(names):
        raise ValueError(f"plane is {plane}: it must be a name or from 0 to {len(names) - 1}")
    return number
