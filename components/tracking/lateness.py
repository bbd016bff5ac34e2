"""What comes late to a tracker: what a scene says of it before a run, and what a run counts."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from components.messages.detections import SensorOffer
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Producer
from dsa_des.time.clock import ClockSpec

# Looks whose fate is worked out.
_MOST_LOOKS = 2000


def may_come_late(offers: Mapping[str, Any], producers: Iterable[Producer]) -> bool:
    """Return whether a look may come after one that was made later.

    Parameters
    ----------
    offers : mapping
        Of the sensors, as the fusion hands them on; who says nothing may be late.
    producers : iterable of Producer
        That feed the tracker.
    """
    return (
        not offers
        or any(one.jitter_s > 0 or one.unforeseen for one in producers)
        or any(
            not isinstance(o, SensorOffer) or o.latest_s is None or o.latest_s > 0 or o.unforeseen
            for o in offers.values()
        )
    )


def latest_s(offers: Mapping[str, Any], producers: Iterable[Producer]) -> Fraction:
    """Return how late a look may come at most, as far as the scene says; queues are not in it."""
    told = [o.latest_s or 0 for o in offers.values() if isinstance(o, SensorOffer)]
    return Fraction(max(told, default=0) + max((one.latest_s for one in producers), default=0))


def left_out(offers: Mapping[str, Any], lag_s: Fraction, duration_s: Fraction) -> dict[str, float]:
    """Return the share of each sensor's looks that come when one is known that is newer by a lag.

    Parameters
    ----------
    offers : mapping
    lag_s : Fraction
        How much newer.
    duration_s : Fraction
        Of the run.

    Returns
    -------
    dict of float
        Of those that have any. Jitter is taken at its worst; sensors that do not say how late they
        come, or by which clock they look, are left out.
    """
    said = {
        name: (o.clock(), o.latest_s, o.jitter_s)
        for name, o in sorted(offers.items())
        if isinstance(o, SensorOffer) and o.clock is not None and o.latest_s is not None
    }
    found = {}
    for name, (clock, latest, jitter) in said.items():
        others = [
            (theirs, latest - (last - spread))
            for other, (theirs, last, spread) in said.items()
            if other != name
        ]
        # Its own looks overtake each other by jitter alone.
        others.append((clock, jitter))
        ahead_s = [(one, by_s) for one, by_s in others if by_s > lag_s]
        if not ahead_s:
            continue
        looks = [t for k in range(_MOST_LOOKS) if (t := _instant(clock, k)) < duration_s]
        late = sum(any(_overtaken(t, one, by_s, lag_s) for one, by_s in ahead_s) for t in looks)
        if late:
            found[name] = late / len(looks)
    return found


def _overtaken(t: Fraction, clock: ClockSpec, by_s: Fraction, lag_s: Fraction) -> bool:
    """Return whether a clock has an instant between ``t + lag_s`` and ``t + by_s``."""
    after = (t + lag_s - clock.offset_s) // clock.period_s + 1
    return _instant(clock, max(int(after), 0)) < t + by_s


def _instant(clock: ClockSpec, scan: int) -> Fraction:
    return clock.offset_s + scan * clock.period_s


def warning(name: str, share: float, why: str) -> str:
    """Return a sentence about looks that will be left out."""
    return f"{why}: up to {share:.0%} of the looks of {name} come too late and are left out"


@dataclass(frozen=True, eq=False)
class LookCount:
    """How many looks of each sensor came, and how many of them too late.

    Parameters
    ----------
    came, left_out : dict of int
        By name of the sensor.
    """

    came: Mapping[str, int] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)

    def of(self, sensors: tuple[str, ...], came: IntArray, left_out: IntArray) -> "LookCount":
        """Return the count with more looks, each a mask of its sensors."""
        return LookCount(
            {n: self.came.get(n, 0) + int((came >> i & 1).sum()) for i, n in enumerate(sensors)},
            {
                n: self.left_out.get(n, 0) + int((left_out >> i & 1).sum())
                for i, n in enumerate(sensors)
            },
        )

    def late(self) -> dict[str, dict[str, float]]:
        """Return looks, those left out and their share, by sensor; of those that lost any."""
        return {
            name: {"looks": self.came[name], "left_out": lost, "share": lost / self.came[name]}
            for name, lost in sorted(self.left_out.items())
            if lost
        }
