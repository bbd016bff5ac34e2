"""Which targets does a run have? Known before it starts, so that effects can ask.

A traffic block announces its targets when it is made; an effect's verdict, asked for when all
blocks are made, looks them up.
"""

from weakref import WeakKeyDictionary

from components.aircraft import Roster
from dsa_des.component import Context
from dsa_des.randomness import Streams

# Blocks of one run share its streams, and no two runs do.
_announced: WeakKeyDictionary[Streams, list[Roster]] = WeakKeyDictionary()


def announce_targets(context: Context, roster: Roster) -> None:
    """Make a traffic block's targets known to the verdicts of the run's effects.

    Parameters
    ----------
    context : Context
        Of the traffic block.
    roster : Roster
        The one its messages carry.
    """
    _announced.setdefault(context.streams, []).append(roster)


def known_targets(context: Context) -> tuple[Roster, ...]:
    """Return the targets announced in a run, by traffic block.

    Parameters
    ----------
    context : Context
        Of any block of the run.

    Returns
    -------
    tuple of Roster
        Those that the blocks feeding us offer, else all that were announced. Empty where there are
        neither: the targets may then be anything.
    """
    offered = tuple(p.offer for p in context.producers if isinstance(p.offer, Roster))
    if offered:
        return offered
    return tuple(_announced.get(context.streams, ()))
