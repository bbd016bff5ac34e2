"""Which targets will a block see? Offered down the chain before effects are planned."""

from components.aircraft import Roster
from dsa_des.component import Context


def known_targets(context: Context) -> tuple[Roster, ...]:
    """Return the rosters that a block's producers offer it.

    A traffic block offers its roster; the transform and the gate pass on what they were offered.

    Parameters
    ----------
    context : Context
        Of the block.

    Returns
    -------
    tuple of Roster
        Empty where nobody says what the targets are: they may then be anything.
    """
    offers = (producer.offer for producer in context.producers)
    return tuple(offer for offer in offers if isinstance(offer, Roster))
