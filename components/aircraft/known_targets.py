"""The targets that a block will see, offered down the chain before effects are planned."""

from collections.abc import Callable
from typing import Any

from components.aircraft.aircraft import Roster
from dsa_des.block.component import Context


class KnownTraffic:
    """What a block offers before a run: targets as a viewer sees them, and where they can be.

    Two offers are equal when their targets are and it was not asked where these can be. `envelope`
    gives, for a reach in m, the time in s that a look lasts and who looks (a target, or -1), the
    run's `components.flights.bounds.TrafficEnvelope`; None where it depends on what will be sensed.
    """

    def __init__(
        self,
        roster: Roster,
        envelope: Callable[[float, float, int], Any] | None,
        viewer: int = -1,
    ) -> None:
        self.roster = roster
        self._envelope = envelope
        self._viewer = viewer
        self._asked = False
        self._views: dict[int, KnownTraffic] = {}

    def seen_from(self, platform: str) -> "KnownTraffic":
        """Return the offer for a viewer aboard this platform, which its roster has as ownship."""
        if platform == self.roster.own_name:
            return self
        target = self.roster.names.index(platform)
        if target not in self._views:
            roster = self.roster.seen_from(target)
            self._views[target] = KnownTraffic(roster, self._envelope, target)
        return self._views[target]

    @property
    def is_envelope_used(self) -> bool:
        """Return whether any block has asked this offer, or a view of it, for the envelope."""
        return self._asked or any(view.is_envelope_used for view in self._views.values())

    def envelope(self, reach_m: float, lasts_s: float) -> Any:
        """Return where targets can be, for a range in m and look time in s; None if unknown."""
        if self._envelope is None:  # of no replica
            return None
        self._asked = True
        return self._envelope(reach_m, lasts_s, self._viewer)

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, KnownTraffic)
            and self.roster == other.roster
            and not (self.is_envelope_used or other.is_envelope_used)
        )

    def __hash__(self) -> int:
        return hash(self.roster)


def offered_rosters(context: Context) -> tuple[Roster, ...]:
    """Return the rosters that a block's producers offer; empty if targets are not known ahead.

    A traffic block offers its roster, alone or as `KnownTraffic`; the transform and the gate pass
    on what they were offered.
    """
    offers = (
        offer.roster if isinstance(offer, KnownTraffic) else offer
        for offer in (producer.offer for producer in context.producers)
    )
    return tuple(offer for offer in offers if isinstance(offer, Roster))
