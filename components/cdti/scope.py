"""The content of the display: it receives a run's messages, and gives the picture at an instant.

The thread of the simulation calls `store_message`; any other may call `page_content`. What they
share is replaced as a whole, never changed.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from components.alert_configuration.configuration import Alerter, Configuration
from components.atmosphere.pressure_altitude import scene_air
from components.cdti.camera import CameraSights
from components.cdti.contacts import (
    Contacts,
    OwnFlight,
    OwnNow,
    contacts_after_lines,
    contacts_of_states,
)
from components.cdti.loss_area import predicted_loss_area
from components.cdti.sensors import describe_sensors, longest_silences_s, silent_sensors
from components.messages.alerts import (
    BAND_KINDS,
    BAND_REGIONS,
    AlertLevels,
    GuidanceBands,
    contact_name,
)
from components.messages.decisions import Decisions
from components.messages.detections import Detections
from components.messages.fused import FusedDetections
from components.messages.state_tracks import StateTracks
from components.messages.targets import TrafficStates
from components.messages.tracks import Tracks
from dsa_des.arrays.types import FloatArray
from dsa_des.block.component import Component
from dsa_des.block.message import Message
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.running.simulation import Simulation
from dsa_des.text.safe_text import escape_unprintable

#: A contact that was not seen for so long is no longer shown, s.
FORGOTTEN_S = 10.0
#: Bands of guidance stand for so long, s: until the alerting has looked again.
BANDS_LAST_S = 1.5
_RELATIVE = ("east_m", "north_m", "up_m", "east_mps", "north_mps", "climb_mps")
_LOOKAHEAD_S = 120.0
_UNKNOWN = (None, None, None)


@dataclass(frozen=True)
class _Alerts:
    """The latest alerts at one instant: contacts, levels, relative states and time to loss."""

    time_s: float
    target: Any
    level: Any
    relative: FloatArray
    own_alt_m: float
    own_mps: FloatArray
    to_loss_s: Any
    closest_m: Any


class Received(NamedTuple):
    """What a display has received up to an instant; nothing of it changes."""

    own: OwnNow | None
    contacts: Contacts | None
    alerts: _Alerts | None
    #: Since when each alert is on, s.
    since: dict[int, float]
    #: Altitude and rate of climb that targets report themselves, m and m/s, and when.
    reported: dict[int, tuple[float, float, float]]
    bands: tuple[float, GuidanceBands] | None
    #: When each sensor was heard of last, s.
    heard: dict[str, float]


class Scope:
    """The state of the display on a platform, by default that of the operator's console.

    It shows what the blocks on board of it say; without a console, on board of the ownship.
    """

    def __init__(self, simulation: Simulation, platform: str | None = None) -> None:
        self._per_s = simulation.ticks_per_s
        self._platform = _display_platform(simulation, platform)
        on = "", self._platform
        components = {n: c for n, c in simulation.components.items() if c.context.platform in on}
        #: Blocks whose messages are shown.
        self._on_board = frozenset(components)
        self._own = OwnFlight()
        self._air = scene_air(simulation.scene.sections)
        self._sights = CameraSights(components)
        self._contacts: Contacts | None = None
        self._alerts: _Alerts | None = None
        self._since: dict[int, float] = {}
        self._reported: dict[int, tuple[float, float, float]] = {}
        self._bands: tuple[float, GuidanceBands] | None = None
        #: What was made of the latest alerts, for as long as they are the latest.
        self._looked: tuple[_Alerts, Any, Any, Any] | None = None
        self._heard: dict[str, float] = {}
        self._silence_s = longest_silences_s(simulation)
        self._names: tuple[str, ...] = ()
        #: Names of all targets, fit to be shown.
        self.names: list[str] = []
        self._rules = _alerting_rules(components)
        senders = {
            type_of
            for block in components.values()
            for type_of in (o.message for o in block.outputs.values())
        }
        kinds = (StateTracks, Tracks, FusedDetections)
        #: What contacts are taken from: the best that the scene has.
        self._believed = next((k for k in kinds if any(issubclass(t, k) for t in senders)), None)
        self.sensors = describe_sensors(components)

    # -- the thread of the simulation ------------------------------------------------------------

    def store_message(self, block: str, message: Message) -> None:
        """Store what the display shows of a message that a block on its platform has sent."""
        if len(message) == 0 or block not in self._on_board:
            return
        if isinstance(message, TrafficStates):
            message = message.seen_from(self._platform or message.roster.own_name)
            self._own.store_states(message, self._per_s)
            self._sights.states = message
            self._store_names(message.roster.names)
        elif isinstance(message, Detections):
            self._heard = {**self._heard, block: int(message.tick[-1]) / self._per_s}
            self._sights.store_detections(block, message, self._per_s)
            self._store_reports(message)
        elif isinstance(message, AlertLevels):
            self._store_alerts(message)
        elif isinstance(message, GuidanceBands):
            last = message.take(slice(len(message) - 1, len(message)))
            self._bands = int(last.tick[0]) / self._per_s, last
        elif self._believed is not None and isinstance(message, self._believed):
            self._store_contacts(message)

    def _store_reports(self, message: Detections) -> None:
        """Store altitude and climb reported by aircraft, if the detections hold any."""
        if "reported_alt_m" not in message.extras:
            return
        altitude, climb = (message.extras[f"reported_{name}"] for name in ("alt_m", "climb_m_s"))
        seen_s = message.measured_ticks() / self._per_s
        rows = zip(message.target, altitude, climb, seen_s, strict=True)
        new = {int(target): (float(a), float(c), float(s)) for target, a, c, s in rows}
        self._reported = {**self._reported, **new}

    def _store_contacts(self, message: Message) -> None:
        count = len(message)
        if isinstance(message, StateTracks):
            last = message.take(slice(count - 1, count))
            self._contacts = contacts_of_states(last, self._own, self._per_s)
        elif isinstance(message, Tracks | FusedDetections):
            for row in range(count):  # a range counts on in the rows after it
                one = message.take(slice(row, row + 1))
                self._contacts = contacts_after_lines(one, self._own, self._per_s, self._contacts)

    def _store_names(self, names: tuple[str, ...]) -> None:
        if names is not self._names:
            self._names, self.names = names, [escape_unprintable(name) for name in names]

    def _store_alerts(self, message: AlertLevels) -> None:
        contacts = message.contact_numbers()
        for row, tick in enumerate(message.tick.tolist()):  # an alert goes on from row to row
            of = slice(int(message.offsets[row]), int(message.offsets[row + 1]))
            on = sorted(contacts[of][message.level[of] > 0].tolist())
            self._since = {t: self._since.get(t, tick / self._per_s) for t in on}
        last = message.take(slice(len(message) - 1, len(message)))
        contacts = last.contact_numbers()
        times = [last.times[name] for name in sorted(last.times)]
        with np.errstate(invalid="ignore"):
            to_loss = np.fmin.reduce(times) if times else np.full(len(contacts), np.nan)
        self._store_names(last.roster.names)
        self._alerts = _Alerts(
            int(last.tick[0]) / self._per_s,
            contacts,
            last.level,
            np.array([last.relative[name] for name in _RELATIVE]),
            float(last.own_motion["alt_m"][0]),
            np.array([last.own_motion[name][0] for name in _RELATIVE[3:]]),
            to_loss,
            last.closest_horizontal_m,
        )

    # -- any thread ------------------------------------------------------------------------------

    @property
    def own_alt_m(self) -> float:
        """The ownship's altitude; infinite before it is known."""
        return math.inf if self._own.now is None else self._own.now.alt_m

    def name_of(self, contact: int) -> str | None:
        """Return a contact's name recorded by the run; empty if unnamed, None for no contact."""
        return contact_name(self._names, contact)

    def received_so_far(self) -> Received:
        """Return an unchanging view of everything received so far; nothing is cleared."""
        return Received(
            self._own.now, self._contacts, self._alerts, self._since, self._reported, self._bands,
            self._heard,
        )  # fmt: skip

    def alert_level_of(self, contact: int) -> int:
        """Return the level of the alert on a contact, 0 without one."""
        if self._alerts is None:
            return 0
        levels = self._alerts.level[self._alerts.target == contact]
        return int(levels.max(initial=0))

    def commanded_value(self, decision: str, value: float) -> float:
        """Return the heading that a turn leads to, deg, or the altitude that a climb does, m."""
        own = self._own.now
        assert own is not None
        if decision == "turn":
            return round((math.degrees(own.heading_rad) + value) % 360.0, 1)
        return round(own.alt_m + value, 1)

    def page_content(self, time_s: float, received: Received | None = None) -> dict[str, Any]:
        """Return what the page shows at an instant, for JSON (m, deg, s): own state, contacts,
        alerts, loss area, bands and failed sensors.
        """
        own, contacts, alerts, since, reported, bands, heard = (
            self.received_so_far() if received is None else received
        )
        if own is None:
            return {
                "own": None, "contacts": [], "alerts": [], "area": [], "bands": {}, "out": []
            }  # fmt: skip
        shown = [] if contacts is None else contacts.rows_to_show(own, time_s, FORGOTTEN_S)
        # What is reported is a pressure altitude, and compared with the ownship's own.
        air = self._air
        own_m = own.alt_m if air is None else float(air.pressure_altitude_m(own.alt_m))
        flights: dict[int, list[float]] = {}
        said: list[dict[str, Any]] = []
        area: list[list[float]] = []
        if alerts is not None:
            if self._looked is None or self._looked[0] is not alerts:
                self._looked = (
                    alerts,
                    _velocities_by_contact(alerts),
                    _alert_fields(alerts, since),
                    self._loss_area(alerts),
                )
            _, flights, said, area = self._looked
        level = {one["target"]: one["level"] for one in said}
        for one in shown:
            flight = [*flights.get(one[0], _UNKNOWN)]
            alt_m, climb, seen_s = reported.get(one[0], (math.nan, math.nan, -math.inf))
            if time_s - seen_s < FORGOTTEN_S and one[3] is not None:
                one[3] = round(alt_m - own_m, 2)
                flight[2] = round(climb, 2) if math.isfinite(climb) else flight[2]
            one += flight
            one.append(level.get(one[0], 0))
        return {
            "own": {
                "heading": round(math.degrees(own.heading_rad) % 360.0, 3),
                "alt": round(own.alt_m, 1),
                "speed": round(own.speed_mps, 1),
                "climb": round(own.climb_mps, 2),
            },
            "contacts": shown,
            "alerts": said,
            "area": area,
            "bands": _bands_at(bands, time_s),
            "out": silent_sensors(self._silence_s, heard, time_s),
        }

    def camera_picture(
        self, picture: dict[str, Any], time_s: float, chosen: int
    ) -> dict[str, Any] | None:
        """Return the newest camera picture of a contact, as of an instant; None if never seen.

        Of contact -1 it is that of the most urgent one.
        """
        own = self._own.now
        if own is None:
            return None
        if chosen < 0:
            first = [one["target"] for one in picture["alerts"][:1]]
            first += [one[0] for one in picture["contacts"][:1]]
            if not first:
                return None
            chosen = first[0]
        return self._sights.picture_of_contact(chosen, self._direction_of(chosen), time_s, own)

    def _direction_of(self, contact: int) -> tuple[float, float] | None:
        """Return a contact's last bearing from north and elevation, rad; None if it is unknown."""
        contacts = self._contacts
        if contacts is None:
            return None
        index = np.flatnonzero(contacts.number == contact)
        if len(index) == 0:
            return None
        bearing, elevation = contacts.toward[index[0]].tolist()
        return bearing, elevation

    def _loss_area(self, alerts: _Alerts) -> list[list[float]]:
        on = np.flatnonzero(alerts.level > 0)
        if self._rules is None or len(on) == 0 or not np.all(np.isfinite(alerts.own_mps)):
            return []
        level = self._rules[0].first_corrective_level(self._rules[1])
        if level is None:
            return []
        relative = alerts.relative[:, on]
        result = predicted_loss_area(
            level.volume, alerts.own_alt_m, alerts.own_mps, relative, _LOOKAHEAD_S
        )
        degrees = np.degrees(result.direction_rad)
        return [
            [round(a, 1), round(b, 1), round(c, 1)]
            for a, b, c in zip(
                degrees.tolist(), result.near_m.tolist(), result.far_m.tolist(), strict=True
            )
        ]


def _bands_at(
    received: tuple[float, GuidanceBands] | None, time_s: float
) -> dict[str, list[list[Any]]]:
    """Return guidance bands at an instant by kind: [from, to, region], deg from north, m, m/s."""
    result: dict[str, list[list[Any]]] = {kind: [] for kind in BAND_KINDS}
    if received is None or time_s - received[0] > BANDS_LAST_S:
        return result
    bands = received[1]
    ends = {
        "direction": np.degrees([bands.low_rad, bands.high_rad]),
        "altitude": np.array([bands.low_m, bands.high_m]),
        "speed": np.array([bands.low_mps, bands.high_mps]),
    }
    rows = zip(bands.band.tolist(), bands.region.tolist(), strict=True)
    for index, (kind, region) in enumerate(rows):
        name = BAND_KINDS[kind]
        result[name].append([*np.round(ends[name][:, index], 1).tolist(), BAND_REGIONS[region]])
    return result


def _alert_fields(alerts: _Alerts, since: dict[int, float]) -> list[dict[str, Any]]:
    """Return the alerts that are on, the most urgent first."""
    result = []
    for index in np.flatnonzero(alerts.level > 0).tolist():
        target = int(alerts.target[index])
        to_loss = float(alerts.to_loss_s[index])
        result.append({
            "target": target,
            "level": int(alerts.level[index]),
            "since": since.get(target, alerts.time_s),
            "at": alerts.time_s,
            "to_loss": round(to_loss, 2) if math.isfinite(to_loss) else None,
            "closest": round(float(alerts.closest_m[index]), 1),
        })  # fmt: skip
    return sorted(result, key=lambda one: (-one["level"], one["to_loss"] or 0.0, one["target"]))


def _velocities_by_contact(alerts: _Alerts) -> dict[int, list[float]]:
    """Return velocity east, north, up, m/s, by contact known to alerting; empty if own is not."""
    moving = alerts.own_mps[:, np.newaxis] - alerts.relative[3:]
    if not np.all(np.isfinite(moving)):
        return {}
    rounded = np.round(moving.T, 2).tolist()
    return {int(t): flight for t, flight in zip(alerts.target, rounded, strict=True)}


def _display_platform(simulation: Simulation, platform: str | None) -> str:
    """Return the displayed platform's name: as asked, else the one with the operator's console.

    Empty where nothing is known to carry a block; `UsageError` for what carries none.
    """
    blocks = simulation.components.values()
    known = sorted({one.context.platform for one in blocks} - {""})
    if platform is not None and platform not in known:
        raise UsageError(
            f"--platform {platform!r}: nothing of this scene is carried by it"
            f"{did_you_mean(platform, known)}"
        )
    consoles = [
        one.context.platform
        for one in blocks
        if any(issubclass(output.message, Decisions) for output in one.outputs.values())
    ]
    first = [name for one in blocks for name in one.platforms()[:1] if name in known]
    return platform or next(iter([*consoles, *first, *known]), "")


def _alerting_rules(components: Mapping[str, Component]) -> tuple[Configuration, Alerter] | None:
    """Return configuration and alerter of the first block sending alert levels; None without."""
    from components.alert_configuration.conf_file import read_conf

    for component in components.values():
        if any(issubclass(o.message, AlertLevels) for o in component.outputs.values()):
            configuration = read_conf(component.p.conf)
            return configuration, configuration.alerters[component.p.alerter - 1]
    return None
