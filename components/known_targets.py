"""Which targets will a block see? Offered down the chain before effects are planned."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from components.aircraft import Roster
from dsa_des.component import Context


@dataclass(frozen=True, eq=False)
class KnownTraffic:
    """What a traffic block offers: what its targets are, and where they can be.

    Parameters
    ----------
    roster : Roster
    envelope : callable
        Gives, for a reach in m, the `components.traffic.envelope.TrafficEnvelope` of the run; to
        be called once the run's length is known.
    """

    roster: Roster
    envelope: Callable[[float], Any]


def known_targets(context: Context) -> tuple[Roster, ...]:
    """Return the rosters that a block's producers offer it.

    A traffic block offers its roster, alone or as `KnownTraffic`; the transform and the gate pass
    on what they were offered.

    Parameters
    ----------
    context : Context
        Of the block.

    Returns
    -------
    tuple of Roster
        Empty where nobody says what the targets are: they may then be anything.
    """
    offers = (
        offer.roster if isinstance(offer, KnownTraffic) else offer
        for offer in (producer.offer for producer in context.producers)
    )
    return tuple(offer for offer in offers if isinstance(offer, Roster))
