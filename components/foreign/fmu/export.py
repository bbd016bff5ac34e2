"""The chain of a scene as an FMU: what is written, and what runs inside it."""

import json
import math
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from components.aircraft.aircraft import Aircraft
from components.embedding.host_scene import load_for_host, traffic_block_name
from components.embedding.simulator import Simulator
from dsa_des.errors import UsageError
from dsa_des.files.output_file import check_file_ending, check_file_writable, write_file
from dsa_des.files.toml_files import to_toml
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene
from dsa_des.terminal.terminal import say

#: What the FMU's resources hold beside the script.
_SCENE, _PLANES = "scene.toml", "planes.json"
#: What pythonfmu3 runs in the FMU; it wants the class to stand in a file of its own.
_SCRIPT = '''"""The chain of a scene of dsa_des, which must be installed for this Python."""

from components.foreign.fmu import export
from pythonfmu3 import CoSimulation, Fmi3Slave, Fmi3Status, Fmi3StepResult
from pythonfmu3 import Boolean, Fmi3Causality, Fmi3Variability, Float64, Int32, Unit


class Chain(Fmi3Slave, CoSimulation):
    """Runs the scene when it is stepped."""

    def __init__(self, **options):
        super().__init__(**options)
        self.chain = export.Chain(self.resources)
        self.description = self.chain.title
        self.register_units([Unit("m", m=1), Unit("rad", rad=1), Unit("s", s=1)])
        self.time = 0.0
        self.register_variable(
            Float64(
                "time", causality=Fmi3Causality.independent,
                variability=Fmi3Variability.continuous, unit="s",
            )
        )
        kinds = {"float": Float64, "bool": Boolean, "int": Int32}
        ways = {"input": Fmi3Causality.input, "output": Fmi3Causality.output}
        for one in self.chain.variables():
            more = {"unit": one.unit} if one.unit else {}
            if one.kind != "float":
                more["variability"] = Fmi3Variability.discrete
            self.register_variable(
                kinds[one.kind](
                    one.name, causality=ways[one.way], description=one.meaning,
                    getter=one.get, setter=one.put, **more,
                ),
                nested=False,
            )

    def exit_initialization_mode(self):
        self.chain.start()

    def do_step(self, current_time, step_size):
        self.chain.step(current_time)
        self.time = current_time + step_size
        return Fmi3StepResult(status=Fmi3Status.ok)
'''
_POSE = {
    "lat_rad": "geodetic latitude (WGS-84)", "lon_rad": "geodetic longitude (WGS-84)",
    "alt_m": "altitude above the ellipsoid", "yaw_rad": "yaw, from north",
    "pitch_rad": "pitch, nose up", "roll_rad": "roll, right wing down",
}  # fmt: skip
_SEEN = {
    "azimuth_rad": "measured azimuth in body axes; 0 where nothing is detected",
    "elevation_rad": "measured elevation in body axes",
    "range_m": "slant range; -1 where no contributing sensor measures it",
}


class _Variable:
    """A variable of the exported FMU, with the dictionary and the key that hold its value."""

    def __init__(
        self, name: str, kind: str, way: str, meaning: str, place: tuple[Any, Any]
    ) -> None:
        self.name, self.kind, self.way, self.meaning = name, kind, way, meaning
        ending = name.rpartition("_")[2]
        self.unit = ending if kind == "float" and ending in ("m", "rad", "s") else None
        table, key = place
        self.get: Callable[[], Any] = partial(table.__getitem__, key)
        self.put: Any = partial(table.__setitem__, key) if way == "input" else None


class Chain:
    """A scene's chain of sensors inside an exported FMU.

    Parameters
    ----------
    folder : str
        The FMU's resources.
    """

    def __init__(self, folder: str) -> None:
        self._scene = Path(folder, _SCENE)
        said = json.loads(Path(folder, _PLANES).read_text(encoding="utf-8"))
        self.title = said["title"]
        self._planes: dict[str, Any] = said["planes"]
        self._own = dict.fromkeys(_POSE, 0.0)
        self._poses = [dict.fromkeys(_POSE, 0.0) | {"present": True} for _ in self._planes]
        nothing = {"detected": False, **dict.fromkeys(_SEEN, 0.0), "range_m": -1.0}
        self._seen = [dict(nothing) for _ in self._planes]
        self._all: dict[str, Any] = {"time_s": 0.0, "scans": 0, "false_alarms": 0}
        self._simulator: Simulator | None = None

    def variables(self) -> list[_Variable]:
        """Return the FMU's variables: all aircraft's poses as inputs, detections as outputs."""
        found = [
            _Variable(f"own_{key}", "float", "input", f"ownship: {meaning}", (self._own, key))
            for key, meaning in _POSE.items()
        ]
        for number, name in enumerate(self._planes):
            pose, seen, at = self._poses[number], self._seen[number], f"plane[{number + 1}]"
            found += [
                _Variable(f"{at}.{key}", "float", "input", f"{name}: {meaning}", (pose, key))
                for key, meaning in _POSE.items()
            ]
            meaning = f"{name}: whether it is there"
            found.append(_Variable(f"{at}.present", "bool", "input", meaning, (pose, "present")))
            meaning = f"{name}: whether any sensor detected it"
            found.append(_Variable(f"{at}.detected", "bool", "output", meaning, (seen, "detected")))
            found += [
                _Variable(f"{at}.{key}", "float", "output", f"{name}: {meaning}", (seen, key))
                for key, meaning in _SEEN.items()
            ]
        for key, kind, meaning in (
            ("time_s", "float", "the instant that the outputs are of"),
            ("scans", "int", "how many sensors scanned then"),
            ("false_alarms", "int", "how many false alarms there were then"),
        ):
            found.append(_Variable(key, kind, "output", meaning, (self._all, key)))
        return found

    def start(self) -> None:
        """Build the simulator with the scene's aircraft and start it."""
        self._simulator = Simulator(self._scene)
        known = self._simulator.planes
        for name, aircraft in self._planes.items():
            if name not in known:
                self._simulator.add_plane(name, aircraft=aircraft)
        self._simulator.start()

    def step(self, time_s: float) -> None:
        """Run the scans due at a time with the input poses; set the outputs from detections."""
        assert self._simulator is not None
        rows = [[pose[key] for key in _POSE] for pose in self._poses]
        for pose, row in zip(self._poses, rows, strict=True):
            if not pose["present"]:
                row[:] = [math.nan] * len(row)
        own = [self._own[key] for key in _POSE]
        result = self._simulator.simulate(
            own[:3], own[3:], [row[:3] for row in rows], [row[3:] for row in rows], time_s
        )
        for seen, sighting in zip(self._seen, result.sightings, strict=True):
            values = dict(zip(_SEEN, sighting.polar, strict=True))
            seen["detected"] = sighting.detected
            for key, none in (("azimuth_rad", 0.0), ("elevation_rad", 0.0), ("range_m", -1.0)):
                seen[key] = none if math.isnan(values[key]) else values[key]
        self._all["time_s"], self._all["scans"] = result.time_s, len(result.scans)
        self._all["false_alarms"] = len(result.false_alarms)


def write_chain_fmu(
    scene: str, out: str, sets: tuple[str, ...] = (), swaps: tuple[str, ...] = (),
    seed: int | None = None,
) -> None:  # fmt: skip
    """Write a scene's chain as an FMU.

    Raises
    ------
    SceneError, UsageError
        If the scene cannot be driven by a host, or the file not be written.
    """
    try:
        from pythonfmu3.builder import FmuBuilder
    except ImportError:
        raise UsageError(
            "dsa-des export-fmu needs the package pythonfmu3: pip install 'dsa-des[fmu]'"
        ) from None
    target = Path(out)
    check_file_ending(target, [".fmu"])
    check_file_writable(target)
    loaded = load_for_host(scene, sets=sets, swaps=swaps, seed=seed)
    Simulator(loaded)  # a scene that no host can drive is refused here
    planes = _aircraft_by_name(loaded)
    said = {"title": loaded.title or loaded.path.stem, "planes": planes}
    with tempfile.TemporaryDirectory(prefix="dsa_des_export_") as folder:
        place = Path(folder)
        script = place / "dsa_des_chain.py"
        script.write_text(_SCRIPT, encoding="utf-8")
        (place / _SCENE).write_text(to_toml(loaded.resolved()), encoding="utf-8")
        (place / _PLANES).write_text(json.dumps(said), encoding="utf-8")
        made = FmuBuilder.build_FMU(
            script, place / "made", [place / _SCENE, place / _PLANES],
            needsExecutionTool="true", canBeInstantiatedOnlyOncePerProcess="false",
            canHandleVariableCommunicationStepSize="true",
        )  # fmt: skip
        write_file(target, made.read_bytes())
    say(f"{target}: {len(planes)} planes ({', '.join(planes)})")


def _aircraft_by_name(scene: Scene) -> dict[str, Any]:
    """Return each aircraft's properties by name, as `Simulator.add_plane` takes them."""
    traffic: Any = Simulation(scene).components[traffic_block_name(scene)]
    roster = traffic.roster
    return {
        name: aircraft.model_dump(
            mode="json", include=set(Aircraft.model_fields), exclude_none=True
        )
        for name, aircraft in zip(roster.names, roster.aircraft, strict=True)
    }
