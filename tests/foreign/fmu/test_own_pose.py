"""What is held of the ownship from one wake to the next: the last that came."""

import numpy as np

from components.foreign.fmu.own_pose import ownship_motion_and_latest
from components.messages.targets import TrafficStates
from dsa_des.arrays.run_ticks import RunTicks
from dsa_des.block.wake import Arrivals, Wake


def told(*ticks: int) -> Arrivals:
    """Rows of a traffic whose ownship is at 10 degrees of latitude and as many more as the tick."""
    tick = np.array(ticks, dtype=np.int64)
    nobody = np.zeros((len(tick), 0))
    others = dict.fromkeys(
        ("lat_deg", "lon_deg", "alt_m", "yaw_rad", "pitch_rad", "roll_rad"), nobody
    )
    own = {f"own_{name}": np.zeros(len(tick)) for name in others}
    own["own_lat_deg"] = 10.0 + tick
    states = TrafficStates(
        tick=tick, **own, **others, present=nobody.astype(bool), roster=None,
        columns=np.zeros(0, dtype=np.int64),
    )  # fmt: skip
    return Arrivals("traffic", RunTicks(np.zeros_like(tick), tick), states)


def seen(ticks: list[int], held: dict, *arrivals: Arrivals) -> tuple[list[float], dict]:
    instants = RunTicks(np.zeros(len(ticks), dtype=np.int64), np.array(ticks))
    wake = Wake(instants, np.full(len(ticks), -1), 1, {}, {"messages": list(arrivals)})
    found, after = ownship_motion_and_latest(wake, "messages", held, moves=False)
    return found[0].tolist(), after


def test_the_last_row_is_held_until_news_come():
    first, held = seen([0, 1, 2, 3], {}, told(0, 2))
    assert first == [10.0, 10.0, 12.0, 12.0]
    second, held = seen([4, 5], held)
    assert second == [12.0, 12.0]
    third, held = seen([6, 7, 8], held, told(7))
    assert third == [12.0, 17.0, 17.0]
    assert seen([9], held)[0] == [17.0]


def test_nothing_is_known_before_the_first_row():
    found, held = seen([0, 1], {}, told(1))
    assert np.isnan(found[0]) and found[1] == 11.0
    assert seen([2], held)[0] == [11.0]
