"""The chain of a scene as a simulator of mosaik; needs the extra ``mosaik``."""

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from components.embedding.result import EncounterResult
from components.embedding.simulator import Simulator
from components.geometry import POSE_FIELDS
from components.messages.detections import Detections
from dsa_des.time.clock import parse_rational

try:
    from mosaik_api_v3 import Simulator as MosaikApi
except ImportError as error:
    raise ImportError(
        "mosaik needs mosaik-api-v3: install it with  pip install 'dsa-des[mosaik]'"
    ) from error

_SEEN = ("azimuth_rad", "elevation_rad", "range_m", "sensors")
_PLANE = ("name", "aircraft", "rcs_dbsm", "swerling", "eo", "ir", "contrast", "contrast_ir")


class ChainOfMosaik(MosaikApi):
    """A scene's sensors and fusion as a simulator for mosaik, stepped at the scene's own scans.

    ``world.start("dsa_des", time_resolution=..., scene=..., seed=...)`` takes what `Simulator`
    does. One ``Ownship`` and any number of ``Plane`` (parameters of `Simulator.add_plane`) take
    ``lat_deg``, ``lon_deg`` (WGS 84), ``alt_m``, ``yaw_rad``, ``pitch_rad`` and ``roll_rad``
    (NED to body; level by default). A plane gives ``azimuth_rad``, ``elevation_rad``, ``range_m``
    (NaN where nothing is detected) and ``sensors``; the ownship gives ``detections``, a list of
    (sensor, name or None, azimuth_rad, elevation_rad, range_m). A plane without a position is not
    there.
    """

    def __init__(self) -> None:
        models: dict[str, Any] = {
            "Ownship": {"public": True, "params": [], "attrs": [*POSE_FIELDS, "detections"]},
            "Plane": {"public": True, "params": [*_PLANE], "attrs": [*POSE_FIELDS, *_SEEN]},
        }
        super().__init__({"type": "time-based", "models": models})
        self._ownship: str | None = None

    def init(self, sid: str, time_resolution: float = 1.0, **sim_params: Any) -> Any:
        """Read the scene and check that its scans fall on mosaik's steps.

        Raises
        ------
        ValueError
            If a step is no whole number of ticks, or a scan falls between two steps.
        """
        self._chain = Simulator(sim_params.pop("scene"), **sim_params)
        scene = self._chain.scene
        self._step_s = parse_rational(time_resolution)
        ticks = self._step_s * scene.ticks_per_s
        if ticks.denominator != 1:
            raise ValueError(
                f"time_resolution is {time_resolution}: a step is {float(ticks):g} ticks of the "
                f"scene, of which there are {scene.ticks_per_s} in a second: it must be whole"
            )
        self._step_ticks = int(ticks)
        between = [
            f"blocks.{name} scans every {clock.period_s} s from {clock.offset_s} s on"
            + (", with errors of its clock" if clock.jitter_s or clock.rate_error_ppm else "")
            for name, block in sorted(scene.blocks.items())
            if (clock := block.cls.clock_of(block.parameters)) is not None
            and (
                clock.jitter_s
                or clock.rate_error_ppm
                or any(
                    (t / self._step_s).denominator != 1 for t in (clock.period_s, clock.offset_s)
                )
            )
        ]
        if between:
            raise ValueError(
                f"time_resolution is {time_resolution} s, and scans fall between mosaik's steps: "
                f"{'; '.join(between)}"
            )
        return self.meta

    def create(self, num: int, model: str, **model_params: Any) -> Any:
        """Create the ownship or planes, and return their entity ids and types."""
        if model == "Ownship":
            if num != 1 or self._ownship is not None:
                raise ValueError("there is one Ownship")
            self._ownship = "Ownship"
            return [{"eid": "Ownship", "type": model}]
        if num > 1 and "name" in model_params:
            raise ValueError(f"name is {model_params['name']!r}: {num} planes need names each")
        names = [self._chain.add_plane(**model_params) for _ in range(num)]
        return [{"eid": name, "type": model} for name in names]

    def setup_done(self) -> None:
        """Build the chain, so that the first step takes no longer than others."""
        self._chain.start()

    def step(self, time: int, inputs: Mapping[str, Any], max_advance: int) -> int:
        """Run this step's scans with the given poses; return the next scan's step number."""
        own = _pose_from_inputs(self._ownship or "Ownship", inputs)
        planes = [_pose_from_inputs(name, inputs) for name in self._chain.planes]
        rows = np.array(planes, dtype=np.float64).reshape(-1, 6)
        self._seen: EncounterResult = self._chain.simulate(
            own[:3], own[3:], rows[:, :3], rows[:, 3:], Fraction(time) * self._step_s
        )
        per_s = self._chain.scene.ticks_per_s
        return round(self._chain.next_scan_s() * per_s) // self._step_ticks

    def get_data(self, outputs: Mapping[str, Iterable[str]]) -> dict[str, dict[str, Any]]:
        """Return the detections of the last step."""
        found: dict[str, dict[str, Any]] = {}
        for entity, attributes in outputs.items():
            if entity == self._ownship:
                found[entity] = {"detections": self._detections()}
                continue
            seen = self._seen[entity]
            said = {**{n: getattr(seen, n) for n in _SEEN[:3]}, "sensors": [*seen.sensors]}
            found[entity] = {name: said[name] for name in attributes}
        return found

    def _detections(self) -> list[tuple[Any, ...]]:
        rows = []
        for block, message in sorted(self._seen.messages.items()):
            if isinstance(message, Detections):
                names = [*message.roster.names, None]
                columns = (message.azimuth_rad, message.elevation_rad, message.range_m)
                rows += [
                    (block, names[target], *(float(column[i]) for column in columns))
                    for i, target in enumerate(message.target.tolist())
                ]
        return rows


def _pose_from_inputs(entity: str, inputs: Mapping[str, Any]) -> list[float]:
    """Return an aircraft's latitude, longitude (rad), altitude (m), yaw, pitch and roll (rad) from
    mosaik's inputs; NaN for a position not given.
    """
    given = inputs.get(entity, {})
    values = {}
    for name, by_source in given.items():
        if len(by_source) != 1:
            raise ValueError(f"{entity}.{name} has {len(by_source)} sources: one is needed")
        values[name] = float(next(iter(by_source.values())))
    there = [values.get(name, math.nan) for name in POSE_FIELDS[:3]]
    turned = [values.get(name, 0.0) for name in POSE_FIELDS[3:]]
    return [*(_round_trip_radians(value) for value in there[:2]), there[2], *turned]


def _round_trip_radians(value_deg: float) -> float:
    """Return an angle (rad) that converts back to exactly the degrees given, else the nearest."""
    near = math.radians(value_deg)
    for angle in (near, math.nextafter(near, math.inf), math.nextafter(near, -math.inf)):
        if float(np.degrees(angle)) == value_deg:
            return angle
    return near
