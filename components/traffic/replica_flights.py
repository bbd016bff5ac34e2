"""The flights of a traffic source in all replicas, put together as one."""

from typing import Any

import numpy as np

from components.aircraft.aircraft import Aircraft, Roster, joint_roster
from components.traffic.fleet import SampledFleet, ScriptedFleet
from components.traffic.flight_limits import intervals_present_s, max_speeds_mps
from components.traffic.flown_together import AllFlown
from components.traffic.legs import ScriptedTrajectory
from components.traffic.trajectory import SampledTrajectory
from dsa_des.block.replica_runs import ReplicaRuns


def flown_by(face: Any, replicas: ReplicaRuns) -> AllFlown | None:
    """Return the flights of all replicas, or None where they cannot be put together.

    Parameters
    ----------
    face : TrafficSource
        As the first replica has it.
    replicas : ReplicaRuns
    """
    type(face).prepare(replicas.parameters)
    parameters = getattr(face, "flown_of", None)
    found: AllFlown | None = None if parameters is None else parameters(replicas.parameters)
    return _made_one_by_one(face, replicas) if found is None else found


def _made_one_by_one(face: Any, replicas: ReplicaRuns) -> AllFlown | None:
    own, targets = [], []
    aircraft: list[tuple[str, Aircraft]] = []
    for number in range(len(replicas)):
        source = replicas.make(number)
        own.append(source.own)
        targets += list(source.targets)
        aircraft += zip(source.roster.names, source.roster.aircraft, strict=True)
    roster = joint_roster(face.roster, aircraft)
    if roster is None:
        return None
    fleets: list[Any] = []
    for flights in (own, targets):
        kinds = {type(flight) for flight in flights}
        if kinds <= {ScriptedTrajectory}:
            fleets.append(ScriptedFleet(flights))
        elif kinds == {SampledTrajectory}:
            fleets.append(SampledFleet(flights))
        else:
            return None
    return flown(fleets[0], fleets[1], own, targets, roster)


def flown(own_fleet: Any, target_fleet: Any, own: Any, targets: Any, roster: Roster) -> AllFlown:
    """Return flights with how fast they are and when they are there.

    Parameters
    ----------
    own_fleet, target_fleet : Fleet
    own, targets : sequence of flights
    roster : Roster
    """
    return AllFlown(
        own_fleet, target_fleet,
        np.asarray(max_speeds_mps(own)), np.asarray(max_speeds_mps(targets)),
        intervals_present_s(own), intervals_present_s(targets), roster,
    )  # fmt: skip
