"""The normalised errors squared of a case's tracks, and what they come to beside chi-square."""

import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from components.messages.state_tracks import COVARIANCE
from components.metrics.separation import traffic_and_duration
from components.metrics.true_states import states_and_presence_in_frame
from docs.make.track_consistency.cases import Case
from docs.make.track_consistency.scenes import scenes_of
from dsa_des.arrays.types import FloatArray
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.lockstep import NotInLockStep, make_lockstep_simulation
from dsa_des.running.simulation import Simulation

INSTANTS_S = np.arange(12.0, 37.0, 4.0)
_AHEAD_S = 5.0
#: A NEES of an honest track is above this once in 10^10.
_LOST_ABOVE = 60.0
_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")


def tracks_of(scenes: list[Any]) -> list[Any]:
    """Return each replica's table of tracks."""
    sink = MemorySink()
    try:
        make_lockstep_simulation(scenes, recorder=Recorder([sink])).run()
    except NotInLockStep:
        tables = []
        for scene in scenes:
            sink = MemorySink()
            Simulation(scene, recorder=Recorder([sink])).run()
            tables.append(sink.tables()["state_tracks"])
        return tables
    table = sink.tables()["state_tracks"].combine_chunks()
    replica = table["replica"].to_numpy()
    cuts = np.searchsorted(replica, np.arange(len(scenes) + 1))
    return [table.slice(a, b - a) for a, b in pairwise(cuts.tolist())]


def nees_of(case: Case, replicas: int) -> FloatArray:
    """Return the NEES of every target's track, (targets of all replicas, instants).

    NaN where no confirmed track with a range lies within `Case.within_m`, 300 m but for coarse
    bearings, now and 5 s ahead in the mean.
    """
    found: list[FloatArray] = []
    with tempfile.TemporaryDirectory() as folder:
        for scenes in scenes_of(case, replicas, Path(folder)):
            targets = traffic_and_duration(scenes[0])[0].targets
            for table in tracks_of(scenes):
                found.append(_of_run(table, targets, case.within_m))
    return np.concatenate(found)


def _of_run(table: Any, targets: list[Any], within_m: float) -> FloatArray:
    columns: Callable[[str], Any] = lambda name: table[name].to_numpy(zero_copy_only=False)  # noqa: E731
    time_s = columns("time_s")
    # A track is taken as it is told by the first message at or after the instant.
    firsts = np.searchsorted(time_s, INSTANTS_S)
    status, ranged = columns("track_status"), columns("has_range")
    nees = np.full((len(targets), len(INSTANTS_S)), np.nan)
    for k, first in enumerate(firsts.tolist()):
        if first == len(time_s):
            continue
        rows = np.flatnonzero(time_s == time_s[first])
        rows = rows[np.isin(status[rows], ("confirmed", "coasted")) & ranged[rows]]
        if len(rows) == 0:
            continue
        part = {n: columns(n)[rows] for n in (*_STATE, *COVARIANCE.values(), "state_s")}
        origin = np.stack([columns(f"origin_{n}")[rows] for n in ("lat_deg", "lon_deg", "alt_m")])
        known, _ = states_and_presence_in_frame(targets, part["state_s"], origin)
        error = np.stack([part[n] for n in _STATE]) - known
        # Where two meet, who flies on elsewhere is another one.
        ahead = error[:, :3] + _AHEAD_S * error[:, 3:]
        away = np.sqrt((error[:, :3] ** 2).sum(axis=1)) + np.sqrt((ahead**2).sum(axis=1))
        spread = np.empty((len(rows), 6, 6))
        for (i, j), name in COVARIANCE.items():
            spread[:, i, j] = spread[:, j, i] = part[name]
        for target, near in enumerate(away.argmin(axis=1).tolist()):
            if away[target, near] < 2.0 * within_m:
                e = error[target, :, near]
                nees[target, k] = e @ np.linalg.solve(spread[near], e)
    return nees


def bounds(count: int) -> tuple[float, float]:
    """Return the 95 % bounds of the mean NEES of so many independent tracks."""
    from scipy.stats import chi2

    low, high = chi2.ppf([0.025, 0.975], 6 * count) / count
    return float(low), float(high)


def summary(nees: FloatArray) -> dict[str, float]:
    """Return the mean over instants, its bounds, the means' range, and the shares inside.

    What is so far off that it cannot be chance is counted as lost, and is not in the means.
    """
    lost = np.isnan(nees) | (nees > _LOST_ABOVE)
    nees = np.where(lost, np.nan, nees)
    count = int((~np.isnan(nees)).sum(axis=0).min())
    low, high = bounds(max(count, 1))
    means = np.nanmean(nees, axis=0)
    single = bounds(1)
    there = nees[~np.isnan(nees)]
    return {
        "tracks": count, "mean": float(np.nanmean(nees)), "low": low, "high": high,
        "least": float(means.min()), "most": float(means.max()),
        "inside": float(((means >= low) & (means <= high)).mean()),
        "share": float(((there >= single[0]) & (there <= single[1])).mean()),
        "median": float(np.median(there)), "lost": float(lost.mean()),
    }  # fmt: skip
