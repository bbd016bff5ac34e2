"""FMUs as blocks (``foreign.fmu``)."""

import math
from collections.abc import Mapping
from copy import copy
from typing import Any

import numpy as np

from components.aircraft.known_targets import offered_rosters
from components.foreign.fmu.message_columns import message_column
from components.foreign.fmu.own_pose import ownship_motion_and_latest, true_lines_of_sight
from components.foreign.fmu.parameters import FmuParameters
from components.foreign.fmu.units import unit_of_column
from components.foreign.signals import Signals
from components.messages.detections import Detections
from components.messages.reach import Reach, combined_farthest_look
from components.messages.steering import Manoeuvre, Manoeuvres
from components.messages.targets import TrafficStates
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.component import Component, Input, Output
from dsa_des.block.message import Message
from dsa_des.block.wake import Wake
from dsa_des.errors import did_you_mean
from dsa_des.time.clock import ClockSpec

#: What a manoeuvre changes; its other fields say how fast.
_CHANGES = ("turn_rad", "climb_m", "speed_mps", "vertical_speed_mps")
#: How long around a look the ownship's flight is asked for, for its velocity.
_LASTS_S = 1.0 / 16.0


class _Saved:
    """A saved state of the FMU, which is freed when nothing refers to it any more."""

    def __init__(self, slot: int, freed: list[int]) -> None:
        self.slot, self._freed = slot, freed

    def __del__(self) -> None:
        self._freed.append(self.slot)


class ForeignFmu(Component):
    """Runs an FMU (FMI 2 or 3) in a process of its own, as a block of the scene.

    It communicates at the scans of its clock, or whenever something arrives: it is stepped up to
    the instant, given its inputs as they are then, and read. Inputs hold their last value.

    Raises
    ------
    FmuError
        If the FMU fails, crashes, or needs longer than ``deadline_s``.

    References
    ----------
    Functional Mock-up Interface 2.0.4 and 3.0.2.
    """

    inputs = {
        "messages": Input(Message, "trigger", "What its inputs are read from.", False, True),
    }
    outputs = {
        "signals": Output(Signals, "Its outputs."),
        "states": Output(TrafficStates, "Traffic with the ownship where the FMU flies it."),
        "manoeuvres": Output(Manoeuvres, "What it commands the ownship to fly."),
        "detections": Output(Detections, "What it detected: a look at each communication point."),
    }
    Parameters = FmuParameters
    windowed = True
    stands_alone = True

    @classmethod
    def class_for(cls, parameters: Any) -> type[Component]:
        """Return the class for an FMU, by whether it saves its state and sends only signals."""
        if parameters.ownship or parameters.manoeuvre or parameters.detections:
            return RewindableFmu if parameters.model.rewindable else cls
        return RewindableSignalFmu if parameters.model.rewindable else SignalFmu

    @classmethod
    def clock_of(cls, parameters: Any) -> ClockSpec | None:
        """Return the FMU's clock, or None if arriving messages decide when it communicates."""
        found: ClockSpec | None = parameters.clock_spec()
        return found

    def records(self) -> list[type[Message]]:
        """Return the recorded message types: signals, and manoeuvres and detections if sent."""
        sent = {Manoeuvres: self.p.manoeuvre, Detections: self.p.detections}
        return [Signals, *(kind for kind, asked in sent.items() if asked)]

    def request(self, port: str) -> Any:
        """Return a request for lines of sight if the FMU needs ownship velocity, else None."""
        if not self.p.wiring.detections.needs_ownship_velocity():
            return None
        return Reach((-math.pi, math.pi), (-0.5 * math.pi, 0.5 * math.pi), lasts_s=_LASTS_S)

    def offer(self, port: str) -> Any:
        """Return what a port offers: the signals' units, the sensor's declaration, or for states
        what the traffic upstream offers.
        """
        if port == "detections":
            return self.p.wiring.detections.offer(self.p.clock_spec())
        if port == "signals":
            return dict(zip(self.p.wiring.names, self.p.wiring.units, strict=True))
        if port == "states":
            offers = [one.offer for one in self.context.producers]
            return next((offer for offer in offers if hasattr(offer, "names")), None)
        return None

    def setup(self) -> None:
        """Start the FMU's process, and see that everything it reads from is there."""
        from components.foreign.fmu.process import process_for

        wiring, model = self.p.wiring, self.p.model
        self._check_sources()
        known = offered_rosters(self.context)
        self._roster = wiring.detections.roster(known)
        self._sees_own = bool(known)
        self._own: dict[tuple[int, str], FloatArray] = {}
        reach = combined_farthest_look(
            c.request for c in self.context.consumers if c.port == "states"
        )
        if self.p.ownship and math.isfinite(reach.range_m) and reach.lasts_s > 0.0:
            raise ValueError(
                "a sensor needs to know where aircraft are between instants, as beam_sweep and "
                "measures_range_rate do: an FMU says where the ownship is at instants only"
            )
        #: Whether its state is saved: where nothing goes back it need not be.
        self._saves = type(self).rewindable and self.context.rewinds
        spec = wiring.spec(self.name, self.context.ticks_per_s, rewinds=self._saves)
        self._process = process_for(model.path, alone=model.alone)
        self._number = self._process.create_instance(spec, self.p.deadline_s)
        self._freed: Any = _Shared()
        self._saved = _Saved(0, self._freed.slots)
        self._last: FloatArray = np.array(wiring.defaults)
        self._set: FloatArray = np.full(len(wiring.defaults), np.nan)
        # Which sources have given a value, and at how many communication points they had not.
        self._fed = np.zeros(len(wiring.sources), dtype=bool)
        self._unfed, self._points = np.zeros(len(wiring.sources), dtype=np.int64), 0
        self._told: FloatArray = np.zeros(len(self.p.manoeuvre))
        self._traffic: Any = None
        self._scales: dict[int, tuple[float, float]] = {}

    def _check_sources(self) -> None:
        fed = {producer.block: producer for producer in self.context.producers}
        clocks = [(name, who) for name, who in self.p.clocks.items() if isinstance(who, str)]
        named = [(key, block) for _, block, _, _, _, key in self.p.wiring.sources]
        for key, block in [*named, *((f"clocks.{name}", who) for name, who in clocks)]:
            if block not in fed:
                raise ValueError(
                    f"{key}: no wire comes from {block!r}{did_you_mean(block, sorted(fed))}"
                )
        for _, block, column, _, variable, key in self.p.wiring.sources:
            offer = fed[block].offer
            if (
                isinstance(offer, dict)
                and offer
                and all(isinstance(u, str) for u in offer.values())
            ):
                if column not in offer:
                    raise ValueError(
                        f"{key}: {block!r} gives no {column!r}{did_you_mean(column, offer)}"
                    )
                self.p.model.unit_factor_and_offset(offer[column], variable)

    def warnings(self) -> list[str]:
        """Return a warning if communication points are not at whole internal steps of the FMU."""
        said = self.p.step_mismatch_note()
        return [] if said is None else [said]

    def failure_counts(self) -> dict[str, tuple[int, int]]:
        """Return for each input whose source has sent nothing how often it kept its start value, of
        how many communication points.
        """
        found: dict[str, tuple[int, int]] = {}
        lacks = zip(self.p.wiring.sources, self._unfed.tolist(), strict=True)
        for (_, block, _, _, _, key), times in lacks if self._points else ():
            what = f"{key} has had nothing from {block} and keeps its start value"
            before = found.get(what, (0, 0))  # of an array, each element counts
            found[what] = before[0] + times, before[1] + self._points
        return found

    def close(self) -> None:
        """End the FMU's process: the simulation is over."""
        self._process.close()

    # -- running -------------------------------------------------------------------------------

    def run(self, wake: Wake) -> Mapping[str, Message] | None:
        """Step the FMU through the instants, and send what it gives."""
        own, wiring = np.arange(len(wake)), self.p.wiring
        scheduled = self.p.model.kind == "se"
        due = self._ticking_clocks_by_row(wake)
        if scheduled:
            own = np.array(
                [row for row in own if due[row] or self._has_fmu_timed_clocks], dtype=np.int64
            )
        elif self.p.clock_spec() is not None:
            own = np.flatnonzero(wake.scans >= 0)
        values, traffic = self._inputs_and_traffic_at_rows(wake, own)
        seen_from = truth = None
        if self.p.detections and self._sees_own:
            moves = wiring.detections.needs_ownship_velocity()
            seen_from, self._own = ownship_motion_and_latest(
                wake, "messages", self._own, moves=moves
            )
            truth = true_lines_of_sight(wake, "messages", len(self._roster))
        if len(own) == 0:
            return None
        rows = np.ascontiguousarray(values[own])
        changed = np.any(rows != np.vstack([self._set[np.newaxis], rows[:-1]]), axis=1)
        self._set = rows[-1].copy()
        freed, self._freed.slots[:] = list(self._freed.slots), []
        answer = self._process.ask(
            {
                "do": "run", "instance": self._number, "slot": self._saved.slot, "freed": freed,
                "ticks": wake.ticks[own].tolist(), "per_s": wake.ticks_per_s,
                "inputs": rows, "changed": changed.tolist(), "due": [due[row] for row in own],
                "save": self._saves,
            },
            self.p.deadline_s,
        )  # fmt: skip
        if self._saves:
            self._saved = _Saved(answer["slot"], self._freed.slots)
        own = own[: answer["done"]]
        if len(own) == 0:
            return None
        for name in ("numbers", "raised"):
            answer[name] = answer[name][: len(own)]
        sent = self._messages(wake.ticks[own], answer, traffic, own)
        if self.p.detections:
            if seen_from is not None and truth is not None:
                seen_from, truth = seen_from[:, own], truth[:, own]
            looks = wiring.detections.message(
                wake.ticks[own], wake.scans[own], answer["numbers"], seen_from, truth, self._roster
            )
            if len(looks):
                sent["detections"] = looks
        return sent

    #: Whether a scheduled FMU has a clock that it sets itself, so that every wake may be its.
    @property
    def _has_fmu_timed_clocks(self) -> bool:
        return any(c.variability in ("countdown", "changing") for c in self.p.model.clocks.values())

    def _ticking_clocks_by_row(self, wake: Wake) -> list[list[int]]:
        """Return for each row the numbers of the input clocks that tick then."""
        per_s, ticks = wake.ticks_per_s, wake.ticks
        due: list[list[int]] = [[] for _ in ticks]
        for number, clock in enumerate(self.p.model.clocks.values()):
            given = self.p.clocks.get(clock.name)
            if self.p.model.kind == "cs" and not isinstance(given, str):
                continue  # the FMU's process knows when
            if clock.interval_s is not None and clock.variability != "triggered":
                shift, interval = int(clock.shift_s * per_s), int(clock.interval_s * per_s)
                ticking = (ticks >= shift) & ((ticks - shift) % interval == 0)
            elif isinstance(given, str):
                came = [a.tick for a in wake.arrivals("messages") if a.source == given]
                ticking = np.isin(wake.ticks, np.concatenate(came)) if came else ticks < 0
            else:
                ticking = np.isin(ticks, [int(time * per_s) for time in given or ()])
            for row in np.flatnonzero(ticking).tolist():
                due[row].append(number)
        return due

    def _inputs_and_traffic_at_rows(self, wake: Wake, own: IntArray) -> tuple[FloatArray, Any]:
        """Return the inputs at each row, and traffic messages with the index of the one that holds.

        `own` are the rows that are communication points.
        """
        fed = np.tile(self._fed, (len(wake), 1))
        values = np.tile(self._last, (len(wake), 1))
        traffic: list[tuple[Any, IntArray]] = []
        for arrivals in wake.arrivals("messages"):
            message = arrivals.message
            place = np.searchsorted(arrivals.tick, wake.ticks, side="right") - 1
            if self.p.ownship and isinstance(message, TrafficStates):
                traffic.append((message, place))
            for n, (at, block, column, which, variable, key) in enumerate(self.p.wiring.sources):
                if block != arrivals.source or not len(message):
                    continue
                if at not in self._scales:
                    unit = unit_of_column(column)
                    if isinstance(message, Signals) and column in message.names:
                        unit = message.units[message.names.index(column)]
                    self._scales[at] = self.p.model.unit_factor_and_offset(unit, variable)
                a, b = self._scales[at]
                came = a * message_column(message, column, which, key) + b
                known = np.isfinite(came)
                held = np.maximum.accumulate(np.where(known, np.arange(len(came)), -1))[place]
                there = (place >= 0) & (held >= 0)
                values[there, at] = came[held[there]]
                fed[there, n] = True
        self._unfed = self._unfed + np.count_nonzero(~fed[own], axis=0)
        self._points += len(own)
        if len(values):
            self._fed = fed[-1].copy()
            self._last = values[-1].copy()
        return values, self._traffic_and_row_indices(wake, traffic)

    def _traffic_and_row_indices(self, wake: Wake, came: list[tuple[Any, IntArray]]) -> Any:
        if not self.p.ownship:
            return None
        parts = [] if self._traffic is None else [self._traffic]
        shift = len(parts)
        place = np.full(len(wake), -1, dtype=np.int64)
        for message, where in came:
            parts.append(message)
            place = where
        if not parts:
            return None
        whole = type(parts[-1]).concatenate(parts)
        rows = np.where(place >= 0, place + shift, shift - 1)
        if rows[-1] >= 0:
            self._traffic = whole.take(rows[-1:])
        return whole, rows

    # -- sending -------------------------------------------------------------------------------

    def _messages(self, ticks: IntArray, answer: Any, traffic: Any, own: IntArray) -> Any:
        wiring = self.p.wiring
        numbers, texts, raised = answer["numbers"], answer["texts"], answer["raised"]
        count, wide = len(ticks), len(wiring.layout)
        values = np.full((count, wide), np.nan)
        values[:, : wiring.number_count] = numbers
        if raised.shape[1]:
            values[:, wide - raised.shape[1] :] = raised
        words = [""] * (count * wide)
        for row, said in enumerate(texts):
            start = row * wide + wiring.number_count
            words[start : start + len(said)] = said
        for (row, place), word in answer["exact"].items():
            words[row * wide + place] = word
        sent: dict[str, Message] = {}
        if wide:
            sent["signals"] = Signals.of_rows(
                ticks, wiring.layout, values, words, wiring.names, wiring.units
            )
        if traffic is not None:
            whole, rows = traffic
            there = rows[own] >= 0
            states = copy(whole.take(rows[own][there]))
            states.tick = ticks[there]
            states.flights = None
            for name, output in self.p.ownship.items():
                place, a, b = wiring.output_index_and_conversion(name, output)
                setattr(states, name, a * numbers[there, place] + b)
            sent["states"] = states
        if self.p.manoeuvre:
            manoeuvres = self._new_manoeuvres(ticks, numbers)
            if manoeuvres is not None:
                sent["manoeuvres"] = manoeuvres
        return sent

    def _new_manoeuvres(self, ticks: IntArray, numbers: FloatArray) -> Manoeuvres | None:
        """Return manoeuvres at the rows whose commanded values are new and not all zero."""
        how = [
            self.p.wiring.output_index_and_conversion(*item) for item in self.p.manoeuvre.items()
        ]
        told = np.stack([a * numbers[:, place] + b for place, a, b in how], axis=1)
        before = np.vstack([self._told[np.newaxis], told[:-1]])
        changes = [place for place, name in enumerate(self.p.manoeuvre) if name in _CHANGES]
        new = np.flatnonzero((told != before).any(axis=1) & (told[:, changes] != 0.0).any(axis=1))
        self._told = told[-1].copy()
        names = list(self.p.manoeuvre)
        return Manoeuvres.at_rows(
            RunTicks.of_run(0, ticks),
            {
                row: Manoeuvre(**dict(zip(names, told[row].tolist(), strict=True)))
                for row in new.tolist()
            },
        )


class RewindableFmu(ForeignFmu):
    """A foreign FMU whose state can be saved, to run ahead and be rewound for a message."""

    rewindable = True


class SignalFmu(ForeignFmu):
    """A foreign FMU that sends no messages other than its signals."""

    outputs = {"signals": ForeignFmu.outputs["signals"]}


class RewindableSignalFmu(SignalFmu):
    """A foreign FMU that sends no messages other than its signals, and whose state can be saved."""

    rewindable = True


class _Shared:
    """The numbers of saved states nothing refers to; rewinding the block does not rewind it."""

    def __init__(self) -> None:
        self.slots: list[int] = []
