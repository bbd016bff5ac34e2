"""What the ownship of a scene was told to fly, rebuilt from the recorded manoeuvres."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from components.flights.steered_flights import ManyFlights, OwnFlights, SteeredFlight
from components.messages.steering import Manoeuvre
from components.metrics.separation import traffic_block
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import Group

_TOLD = Manoeuvre._fields

#: Manoeuvres and when they came, s, in order.
Told = Sequence[tuple[float, Manoeuvre]]


def flown_as_told(own: Sequence[Any], told: Sequence[Told]) -> list[SteeredFlight]:
    """Return what ownships fly that were told to.

    Parameters
    ----------
    own : sequence of flights
    told : sequence of Told
        Of each of them; at least one manoeuvre.
    """
    flights = OwnFlights(ManyFlights(own), len(own))
    for turn in range(max(map(len, told), default=0)):
        now = [number for number, one in enumerate(told) if len(one) > turn]
        times_s = np.array([told[number][turn][0] for number in now])
        flights.steer(np.array(now), times_s, [told[number][turn][1] for number in now])
    return [SteeredFlight(flight, flights.parts_of(number)) for number, flight in enumerate(own)]


class ToldManoeuvres:
    """The manoeuvres that reach the traffic block of a scene.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    ValueError
        If a wire's delay varies: when its manoeuvres begin is not recorded.
    """

    def __init__(self, scene: Scene) -> None:
        traffic = traffic_block(scene).name
        #: Block that steers → how long its word is on the way.
        self._delays_s: dict[str, float] = {}
        for wire in scene.wires:
            if (wire.target, wire.input) == (traffic, "manoeuvres"):
                if wire.jitter_s or wire.drop_probability or wire.queued or wire.delay_scans:
                    raise ValueError(
                        f"the wire from {wire.source!r} to {traffic!r} must have a fixed delay in "
                        "seconds, without jitter, loss or a processor: when manoeuvres begin is "
                        "not recorded"
                    )
                self._delays_s[wire.source] = float(wire.total_delay_s)

    def __bool__(self) -> bool:
        """Whether anything steers the ownship."""
        return bool(self._delays_s)

    @property
    def tables(self) -> dict[str, tuple[str, ...]]:
        """Tables and columns that a metric has to read for it."""
        return {"manoeuvres": ("block", "time_s", *_TOLD)} if self else {}

    def of(self, group: Group) -> Mapping[int, Told]:
        """Return the manoeuvres of every replica of a group that has any."""
        found: dict[int, list[tuple[float, Manoeuvre]]] = {}
        if not self:
            return found
        table: Any = group.tables["manoeuvres"]
        names = table["block"].names
        rows = zip(
            table["replica"].tolist(), table["block"].codes.tolist(), table["time_s"].tolist(),
            *(table[name].tolist() for name in _TOLD), strict=True,
        )  # fmt: skip
        for replica, block, time_s, *told in rows:
            if names[block] not in self._delays_s:
                continue
            came_s = time_s + self._delays_s[names[block]]
            if came_s < group.duration_s[replica]:
                found.setdefault(replica, []).append((came_s, Manoeuvre(*told)))
        return {replica: sorted(told, key=lambda one: one[0]) for replica, told in found.items()}
