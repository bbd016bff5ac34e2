"""Steering: manoeuvres on their way to the platforms that fly them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from components.flights.many_flights import SteeredFleet
from components.messages.steering import Manoeuvre
from dsa_des.arrays.keyed_table import KeyedTable, indices_by_occurrence
from dsa_des.arrays.run_ticks import RunTicks, first_position_at_or_after
from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Producer
from dsa_des.block.wake import Wake
from dsa_des.time.clock import MAX_TICK


def platform_index_by_steerer(
    producers: Sequence[Producer], index: Callable[[str], int], unseen: Collection[int]
) -> dict[str, int]:
    """Return steered platforms' indices by steering block; ValueError if two steer the same."""
    steering: dict[int, str] = {}
    for producer in producers:
        platform = index(producer.platform)
        if platform in unseen:
            raise ValueError(
                f"{producer.block} is on {producer.platform!r}, which stands and is not "
                "steered: on the way from there to an aircraft a block must say that it is on "
                "that one (platform = ...)"
            )
        other = steering.setdefault(platform, producer.block)
        if other != producer.block:
            raise ValueError(
                f"{other} and {producer.block} both steer {producer.platform!r}: one block "
                f"decides for each aircraft; put one of them on another (platform = ...), or "
                "leave its wire out"
            )
    return {block: platform for platform, block in steering.items()}


class Coming(KeyedTable):
    """Table of received manoeuvres still to be flown: run, tick, platform and manoeuvre."""

    @classmethod
    def empty_table(cls) -> Coming:
        """Return a table with no manoeuvre."""
        types = {"replica": int, "tick": int, "platform": int, "manoeuvre": float}
        return cls.empty(types, {"manoeuvre": (len(Manoeuvre._fields),)})

    @property
    def instants(self) -> RunTicks:
        """Run and tick at which each manoeuvre was received."""
        return RunTicks(self.replica, self.tick)


def arrived_manoeuvres(wake: Wake, steers: Mapping[str, int]) -> list[Coming]:
    """Return tables of manoeuvres since the last wake; `steers` maps blocks to platforms."""
    return [
        Coming(
            replica=np.array(new.message.run),
            tick=new.tick,
            platform=np.full(len(new.tick), steers[new.source]),
            manoeuvre=new.message.manoeuvre_array().T,
        )
        for new in wake.arrivals("manoeuvres")
    ]


def split_due_manoeuvres(wake: Wake, pending: Coming) -> tuple[Coming, Coming]:
    """Return two tables: manoeuvres that rows of this wake fly, and those only of later rows.

    What comes after the last row is for the next wake: what is flown at the end of a run must not
    depend on how far a window reached beyond it.
    """
    pending = pending.take(np.lexsort((pending.platform, pending.tick, pending.replica)))
    came = pending.instants
    row = first_position_at_or_after(
        wake.instants, came
    )  # the first that flies it, if it is of its ownship
    due = (row < len(wake)) & (wake.run[np.minimum(row, len(wake) - 1)] == came.run)
    return pending.take(due), pending.take(~due)


def add_due_manoeuvres(
    fleet: SteeredFleet, flights: IntArray, due: Coming, wake: Wake, each: IntArray
) -> tuple[SteeredFleet, IntArray]:
    """Return the fleet with due manoeuvres in `flights`, and the number known (rows, platforms).

    `each` (rows, platforms) are the flights that a row speaks of. It knows the manoeuvres that have
    come by its own instant, whatever came later in this wake.
    """
    known: IntArray = fleet.manoeuvre_count[each]
    for one in indices_by_occurrence(flights):  # the first of every flight, then the next
        ticks = due.tick[one]
        fleet = fleet.add_manoeuvres(
            flights[one], ticks / wake.ticks_per_s, due.manoeuvre[:, one].T
        )
        came = np.full(len(fleet), MAX_TICK)
        came[flights[one]] = ticks
        known += wake.ticks[:, np.newaxis] >= came[each]
    return fleet, known
