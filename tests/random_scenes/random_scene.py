"""Random legal scenes: odd wirings of all blocks, with delays, loss and loops.

A scene is a function of its seed alone. What a scene holds is noted as features, so that whoever
runs many can see that nothing was left out.
"""

import string
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import random_blocks
import random_flights
from dice import Dice
from random_changes import outages, pulses, timed, weather_cells
from random_platforms import equip

from dsa_des.errors import SceneError
from dsa_des.files.toml_files import to_toml
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import Scene, load_scene

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
# Scan by scan, a scan of one sensor takes some milliseconds; this many keep a run below half a
# second. The geodesic takes 0.1 ms for every target and scan.
_MOST_SCANS = (60, 120, 200)
_MOST_GEODESICS = 5
_MOST_ATTEMPTS = 60


@dataclass
class Case:
    """One random scene.

    Parameters
    ----------
    seed : int
    tables : dict
        The scene as plain TOML values.
    files : dict
        Text of the files it reads, by name.
    features : set of str
        What was put into it.
    refused : list of str
        Why the scenes that were tried before it are not legal.
    """

    seed: int
    tables: dict[str, Any]
    files: dict[str, str]
    features: set[str]
    refused: list[str] = field(default_factory=list)

    def write(self, folder: Path, name: str = "scene.toml") -> Path:
        """Write the scene and what it reads, and return the scene's path."""
        folder.mkdir(parents=True, exist_ok=True)
        for file, text in self.files.items():
            (folder / file).write_text(text, encoding="utf-8")
        path = folder / name
        path.write_text(to_toml(self.tables), encoding="utf-8")
        return path

    def load(self, folder: Path) -> Scene:
        """Write and read the scene."""
        return load_scene(self.write(folder))

    def reordered(self, dice: Dice) -> "Case":
        """Return the same scene with blocks and wires in another order."""
        blocks, wires = list(self.tables["blocks"].items()), list(self.tables["wires"])
        dice.shuffle(blocks)
        dice.shuffle(wires)
        tables = {**self.tables, "wires": wires, "blocks": dict(blocks)}
        place = {id(wire): number for number, wire in enumerate(wires)}
        now = {f"wires[{n}]": f"wires[{place[id(w)]}]" for n, w in enumerate(self.tables["wires"])}
        changes = []
        for change in tables.pop("changes", ()):
            ((key, value),) = change["set"].items()
            of, dot, rest = key.partition(".")
            changes.append({**change, "set": {f"{now.get(of, of)}{dot}{rest}": value}})
        if changes:
            tables["changes"] = changes
        return replace(self, tables=tables)


def legal_case(seed: int, folder: Path, changing: float = 0.2, equipped: float = 1 / 3) -> Case:
    """Return the scene of a seed: the first of those drawn that is legal, written to a folder.

    In a share of all scenes, `changing`, something changes while they run; in another, `equipped`,
    others than the ownship carry sensors too.

    Raises
    ------
    RuntimeError
        If none is.
    """
    refused: list[str] = []
    aboard = Dice(13 * seed + 3)
    is_equipped = aboard.chance(equipped)
    for attempt in range(_MOST_ATTEMPTS):
        case = _Maker(Dice(1000 * seed + attempt)).case(seed)
        try:
            alone = case.load(folder)
            if is_equipped:
                aboard.features.clear()
                equip(case.tables, alone, aboard)
                case.features |= aboard.features
        except SceneError as error:
            refused += [problem.message for problem in error.problems]
            continue
        apart = Dice(11 * seed + 5 + attempt)  # scenes in which nothing changes stay what they were
        newer = Dice(17 * seed + 7 + attempt)
        if newer.chance(changing / 2, "pulses that fold"):
            pulses(case.tables, newer)
        if newer.chance(changing / 2, "weather in places"):
            weather_cells(case.tables, newer)
        case.features |= newer.features
        if apart.chance(changing, "changes") and (changes := timed(case.tables, apart)):
            case.tables["changes"] = changes
            case.features |= apart.features
        if apart.chance(changing / 2, "outages"):
            case.tables["outages"] = outages(case.tables, apart)
            case.features |= apart.features
        try:
            Simulation(case.load(folder))
        except SceneError as error:
            refused += [problem.message for problem in error.problems]
            continue
        case.refused = refused
        return case
    raise RuntimeError(f"seed {seed}: no legal scene in {_MOST_ATTEMPTS}: {refused[-1]}")


class _Maker:
    """Puts one scene together, from the traffic to the avoidance."""

    def __init__(self, dice: Dice) -> None:
        self.dice = dice
        self.blocks: dict[str, Any] = {}
        self.wires: list[dict[str, Any]] = []
        self.files = random_flights.table_files()
        self.processors: dict[str, Any] = {}

    def case(self, seed: int) -> Case:
        dice = self.dice
        duration = dice.pick(2, 3, 5, 8, 12, 20, 40)
        loop = dice.chance(0.45, "loop")
        chains = 2 if dice.chance(0.1, "two sources") else 1
        for _ in range(chains):
            self._chain(duration, loop)
        self._steer_the_other()
        cued = dice.chance(0.12, "cue loop")
        if cued:
            self._cue_loop()
        # In a scene with many wires some would be slow or lossy all but surely, and scenes whose
        # wires are good are run in other ways: in windows, in lock step.
        self.trouble = dice.pick("none", "none", "late", "lossy", "lossy")
        dice.features.add(f"trouble on the way: {self.trouble}")
        if self.trouble == "lossy":
            self._shared_processors()
        if self.trouble != "none":
            self._latencies()
        for wire in self.wires:
            self._faults(wire, loop or cued)
        self._tables_of_all_aircraft()
        if any(table["type"] == "geometry.geodesic" for table in self.blocks.values()):
            for table in self.blocks.values():
                if table["type"] == "traffic.random":
                    table["intruders"] = min(table["intruders"], _MOST_GEODESICS)
        # With dice of their own: scenes without such trackers stay what they were.
        apart = Dice(7 * seed + 1)
        if apart.chance(0.3):
            self._estimating(apart)
        if apart.chance(0.2):
            self._ending(apart)
        tables = {
            "title": f"random {seed}",
            "duration_s": self._short_enough(duration),
            "seed": dice.randrange(1000),
            "wires": self.wires,
            **random_blocks.sections(dice),
            **({"processors": self.processors} if self.processors else {}),
            "blocks": self.blocks,
        }
        return Case(seed, tables, self.files, dice.features)

    def _estimating(self, dice: Dice) -> None:
        """Let trackers that nobody listens to estimate states; sensors then err."""
        heard = {wire["from"] for wire in self.wires}
        trackers = [name for name, table in self.blocks.items()
                    if table["type"] == "tracking.stub" and name not in heard]  # fmt: skip
        for name in trackers:
            self.blocks[name] = random_blocks.estimating_tracker(dice)
            self.dice.features.add("tracker that estimates")
            for wire in self.wires:
                if wire["to"] == name and dice.chance(0.6, "fusion.pass_through"):
                    self.blocks[wire["from"]] = {"type": "fusion.pass_through"}
        self.dice.features |= dice.features
        for table in self.blocks.values() if trackers else ():
            if table["type"].startswith(("radar.", "optical.range")):
                for key in ("azimuth_resolution_deg", "elevation_resolution_deg"):
                    table.setdefault(key, 1.0)
            if table["type"].startswith("radar."):
                table.setdefault("range_resolution_m", 30)

    def _ending(self, dice: Dice) -> None:
        """Let the run end when the aircraft of one source have passed."""
        if self.processors:
            return
        self.dice.features.add("ends early")
        sources = [name for name, t in self.blocks.items() if t["type"].startswith("traffic.")]
        self.blocks["over"] = random_blocks.closest_approach_passed(dice)
        self.dice.features |= dice.features
        wire = {"from": dice.choice(sources), "to": "over"}
        self.wires.append({**wire, **dice.pick({}, {}, {"delay_s": 0.2}, {"jitter_s": 0.1})})

    # -- blocks and wires ----------------------------------------------------------------------

    def _add(self, kind: str, table: dict[str, Any]) -> str:
        letter = self.dice.choice(string.ascii_lowercase) + "_" if self.dice.chance(0.3) else ""
        name = f"{letter}{kind}{len(self.blocks)}"
        self.blocks[name] = table
        return name

    def _wire(self, source: str, target: str) -> None:
        self.wires.append({"from": source, "to": target})

    def _chain(self, duration: float, loop: bool) -> None:
        dice = self.dice
        shipped = str(CONFIGS / "encounters" / "crossing.daa")
        traffic = self._add("traffic", random_flights.traffic(dice, duration, self.files, shipped))
        places = self._places(traffic)
        many = dice.chance(0.004, "over 63 sensors")
        sensors = []
        for number in range(66 if many else dice.choices(range(1, 6), (6, 5, 4, 2, 1))[0]):
            table = random_blocks.sensor(dice, loop)
            if many:
                table = {"type": "radar.range_boundary", "range_km": 5, "scan_rate_hz": 1}
            name = self._add("sensor", table)
            place = dice.choice(places)
            self._wire(place, name)
            if number and place.startswith("transform"):
                dice.features.add("sensor behind a transform")
            sensors.append(name)
        fusions = self._fusions(sensors)
        trackers = self._followers("tracker", fusions, random_blocks.tracker, 0.9)
        avoidances = self._followers(
            "avoidance", trackers, random_blocks.avoidance, 1.0 if loop else 0.15
        )
        if loop and avoidances:
            self.wires.append(self._back(dice.choice(avoidances), traffic))

    def _places(self, traffic: str) -> list[str]:
        """Lay transforms and gates, and return where sensors may be wired."""
        dice, places = self.dice, []
        for _ in range(2 if dice.chance(0.12, "several transforms") else 1):
            transform = self._add("transform", random_blocks.transform(dice))
            self._wire(traffic, transform)
            gates = dice.choices((0, 1, 2), (3, 12, 2))[0]
            if gates == 0:
                dice.features.add("no gate")
            if gates == 0 or dice.chance(0.15, "sensors may skip the gate"):
                places.append(transform)
            before = transform
            for number in range(gates):
                gate = self._add("gate", {"type": "gate"})
                in_series = number and dice.chance(0.5, "gates in series")
                self._wire(before if in_series else transform, gate)
                places.append(gate)
                before = gate
        return places

    def _fusions(self, sensors: list[str]) -> list[str]:
        dice, fusions = self.dice, []
        for number in range(dice.choices((0, 1, 2), (1, 12, 3))[0]):
            name = self._add("fusion", random_blocks.fusion(dice))
            several = len(sensors) > 1 and dice.chance(0.3, "sensors without fusion")
            count = dice.randint(1, len(sensors)) if several else len(sensors)
            for sensor in dice.sample(sensors, count):
                self._wire(sensor, name)
            fusions.append(name)
            if number:
                dice.features.add("several fusions")
        return fusions

    def _followers(self, kind: str, before: list[str], make: Any, share: float) -> list[str]:
        dice, found = self.dice, []
        for source in before:
            if not dice.chance(share):
                continue
            for number in range(2 if dice.chance(0.1) else 1):
                name = self._add(kind, make(dice))
                self._wire(source, name)
                found.append(name)
                dice.features.add(kind)
                if number:
                    dice.features.add(f"several {kind}s behind one block")
        return found

    def _steer_the_other(self) -> None:
        """Let what one ownship senses steer the other, where that is free: no loop at all."""
        steered = {wire["to"] for wire in self.wires if _kind(wire["to"]) == "traffic"}
        free = [name for name in self.blocks if _kind(name) == "traffic" and name not in steered]
        avoidances = [name for name in self.blocks if _kind(name) == "avoidance"]
        for traffic in free[1:]:
            before = list(self.blocks).index(traffic)
            others = [name for name in avoidances if list(self.blocks).index(name) < before]
            if others and self.dice.chance(0.7, "steered by another ownship"):
                self._wire(self.dice.choice(others), traffic)

    def _cue_loop(self) -> None:
        """Add sensors whose own tracks tell them where to look harder, by one tracker or two."""
        dice = self.dice
        places = [n for n in self.blocks if _kind(n) in ("transform", "gate")]
        sensors, trackers = [], []
        for table in (random_blocks.cued_radar(dice), random_blocks.spotter(dice)):
            sensors.append(self._add("sensor", table))
            self._wire(dice.choice(places), sensors[-1])
        apart = dice.chance(0.4, "fusion.covariance_intersection")
        for watched in [[sensor] for sensor in sensors] if apart else [sensors]:
            fusion = self._add("fusion", {"type": "fusion.pass_through"})
            for sensor in watched:
                self._wire(sensor, fusion)
            trackers.append(self._add("estimator", random_blocks.estimator(dice)))
            self._wire(fusion, trackers[-1])
        if apart:
            whole = self._add("estimator", {"type": "fusion.covariance_intersection"})
            for tracker in trackers:
                self._wire(tracker, whole)
            trackers = [whole]
        cues = self._add("cues", random_blocks.cues(dice))
        self._wire(trackers[-1], cues)
        delay = dice.pick(0.05, 0.3, 1, "1/3")
        self.wires.append({"from": cues, "to": sensors[0], "delay_s": delay, "holds": {}})

    def _back(self, avoidance: str, traffic: str) -> dict[str, Any]:
        """Return the wire that closes a loop."""
        self.dice.features.add("closed loop")
        delay = self.dice.pick(0.05, 0.2, 0.7, 1.3, "1/3", 5)
        return {"from": avoidance, "to": traffic, "holds": "nothing", "delay_s": delay}

    # -- time on the way -----------------------------------------------------------------------

    def _shared_processors(self) -> None:
        dice = self.dice
        if not dice.chance(0.35, "shared processors"):
            return
        for name in ("cpu", "gpu")[: dice.randint(1, 2)]:
            self.processors[name] = {"service_s": dice.pick(0.001, 0.02, 0.3, "1/7")}
            dice.maybe(self.processors[name], "service_spread_s", 0.4, 0.01, 0.5)
            dice.maybe(self.processors[name], "when_busy", 0.6, "wait", "drop_oldest", "skip")
        for name, table in self.blocks.items():
            if dice.chance(0.3):
                table["processor"] = dice.choice(sorted(self.processors))
                dice.features.add(f"processor of {_kind(name)}")

    def _latencies(self) -> None:
        for name, table in self.blocks.items():
            if self.dice.chance(0.12):
                table["latency_s"] = self.dice.pick(0.001, 0.1, 0.25, "1/3", 2)
                self.dice.features.add(f"latency of {_kind(name)}")

    def _faults(self, wire: dict[str, Any], loop: bool) -> None:
        """Make a wire slow, unsteady or lossy; in a loop it then holds nothing at first."""
        dice, sender = self.dice, self.blocks[wire["from"]]
        where = f"{_kind(wire['from'])} -> {_kind(wire['to'])}"
        if self.trouble != "none" and "delay_s" not in wire:
            if dice.chance(0.15, f"delay_s {where}"):
                wire["delay_s"] = dice.pick(0.001, 0.05, 0.1, 0.5, "1/3", 2)
            elif dice.chance(0.08, f"delay in scans {where}"):
                wire["delay"] = dice.pick("1 scan", "2 scans", "5 scans")
        if self.trouble == "lossy":
            if dice.chance(0.15, f"jitter_s {where}"):
                wire["jitter_s"] = dice.pick(0.001, 0.01, 0.3, 2)
            if dice.chance(0.15, f"drop_probability {where}"):
                wire["drop_probability"] = dice.pick(0.1, 0.5, 1.0)
        late = {"delay_s", "delay"} & set(wire) or {"latency_s", "processor"} & set(sender)
        if "holds" not in wire and ((loop and late) or dice.chance(0.05)):
            wire["holds"] = "nothing"
        if _kind(wire["to"]) == "avoidance" and dice.chance(0.3, "initial message"):
            wire["holds"] = {}

    # -- what must fit together ----------------------------------------------------------------

    def _tables_of_all_aircraft(self) -> None:
        """Give every aircraft a silhouette table where a camera asks for one."""
        if not any(table.get("silhouette") == "aspect_table" for table in self.blocks.values()):
            return
        areas = {"front_m2": 12.0, "side_m2": 30.0, "horizontal_m2": 90.0}
        areas_with_table = {**areas, "silhouette_table": "area.csv"}
        for table in self.blocks.values():
            if not table["type"].startswith("traffic."):
                continue
            one = table.get("intruder", table.get("aircraft"))
            for aircraft in table.get("intruders", []) if one is None else [one]:
                aircraft["eo"] = areas_with_table
                aircraft["ir"] = {**areas_with_table, "back_m2": 12.0}

    def _short_enough(self, duration: float) -> Any:
        """Return the duration, or what of it holds not too many scans; now and then odd."""
        rate = sum(
            float(Fraction(str(table["scan_rate_hz"])))
            for table in self.blocks.values()
            if "scan_rate_hz" in table
        )
        longest = self.dice.pick(*_MOST_SCANS) / rate
        if duration > longest:
            duration = max(1, int(longest))
        return f"{3 * duration + 1}/3" if self.dice.chance(0.1, "odd duration") else duration


def _kind(name: str) -> str:
    """Return what a block is, from the name it was given."""
    return name.rstrip(string.digits).rsplit("_", 1)[-1]
