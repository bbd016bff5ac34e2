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
        Empty where no traffic block announces its targets: they may then be anything.
    """
    return tuple(_announced.get(context.streams, ()))
