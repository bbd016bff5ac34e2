"""Straight flights that are prepared together have the bits of each alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.flights.geodesic_motion import geodesic_parameters
from components.flights.leg_motion import turn_parameters
from components.flights.legs import Straight, Turn, segments_of_each
from components.flights.many_flights import straight_fleet
from components.flights.scripted_flights import ScriptedFleet, ScriptedTrajectory

latitudes = st.floats(-90, 90) | st.sampled_from([90.0, -90.0, 0.0, -0.0, 52.0])
headings = st.floats(-720, 720) | st.sampled_from([0.0, 90.0, 180.0, 270.0, 360.0])
rows = st.tuples(
    latitudes, st.floats(-400, 400), st.floats(-400, 20_000), headings, st.floats(0.1, 400),
    st.floats(-30, 30),
)  # fmt: skip
optional = st.none() | st.floats(-80, 400)
flights = st.tuples(rows, st.tuples(optional, optional, optional),
                    st.floats(0, 50), st.none() | st.floats(50, 100))  # fmt: skip


@settings(max_examples=200)
@given(st.lists(rows, min_size=1, max_size=5))
def test_tables_are_equal_to_the_bit(given_rows):
    columns = np.array(given_rows).T
    columns[3] = np.radians(columns[3])
    together = geodesic_parameters(*columns)
    alone = np.stack([geodesic_parameters(*row) for row in columns.T.tolist()], axis=1)
    assert together.tobytes() == alone.tobytes()


def starts_of(drawn):
    columns = np.array([row for row, *_ in drawn]).T
    fixed = np.array([[np.nan if a is None else a for a in angles] for _, angles, *_ in drawn]).T
    ends = [np.inf if end is None else end for *_, end in drawn]
    names = [f"t{i}" for i in range(len(drawn))]
    start_s = np.array([start for _, _, start, _ in drawn])
    of = ("lat_deg", "lon_deg", "alt_m", "heading_deg", "speed_mps", "climb_mps")
    return straight_fleet(
        names, **dict(zip(of, columns, strict=True)), start_time_s=start_s,
        end_time_s=np.array(ends), fixed_deg=fixed,
    )  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.lists(flights, min_size=1, max_size=6), st.data())
def test_flights_together_fly_as_each_alone(drawn, data):
    alone = [
        ScriptedTrajectory(
            f"t{i}", lat_deg=row[0], lon_deg=row[1], alt_m=row[2], heading_deg=row[3],
            speed_mps=row[4], climb_mps=row[5], yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll,
            start_time_s=start, end_time_s=end,
        )
        for i, (row, (yaw, pitch, roll), start, end) in enumerate(drawn)
    ]  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:  # none is made by itself
        patch.setattr("components.flights.many_flights.ScriptedTrajectory", None)
        together = starts_of(drawn)
    each = ScriptedFleet(alone)
    assert [flight.name for flight in together] == [flight.name for flight in alone]
    assert together.max_speeds_mps.tolist() == [f.max_speed_mps for f in alone]
    assert together.intervals_present_s.tolist() == [[*f.interval_present()] for f in alone]
    times = np.array([-1.0, 0.0, 49.5, 77.7, 5000.0])
    fleets = [together, each]
    pairs = [(one.at(times), other.at(times)) for one, other in zip(together, alone, strict=True)]
    pairs.append(tuple(fleet.at(times) for fleet in fleets))
    which = np.array(data.draw(st.lists(st.integers(0, len(alone) - 1), max_size=8)), dtype=int)
    pairs.append(tuple(fleet.each(which, np.linspace(0, 90, len(which))) for fleet in fleets))
    chosen = np.unique(which)
    pairs.append(tuple(fleet.subset(chosen).at(times) for fleet in fleets))
    for one, other in pairs:
        for a, b in zip(one.arrays(), other.arrays(), strict=True):
            assert np.ascontiguousarray(a).tobytes() == np.ascontiguousarray(b).tobytes()


def plain(**changes):
    columns = {"lat_deg": 52.0, "lon_deg": 4.0, "alt_m": 100.0, "heading_deg": 10.0,
               "speed_mps": 50.0, "climb_mps": 0.0, "start_time_s": 0.0,
               "end_time_s": np.inf} | changes  # fmt: skip
    return straight_fleet(
        ["a", "b"], **{k: np.array([v, v]) for k, v in columns.items()},
        fixed_deg=np.full((3, 2), np.nan),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "said"),
    [({"alt_m": 2e6}, "a: alt_m"), ({"lat_deg": 91.0}, "a: lat_deg"),
     ({"start_time_s": 5.0, "end_time_s": 3.0}, "a: end_time_s"),
     ({"heading_deg": np.inf}, "a: heading_deg"), ({"speed_mps": -1.0}, "a: speed_mps")],
)  # fmt: skip
def test_what_one_flight_refuses_is_refused_of_many(changes, said):
    with pytest.raises(ValueError, match=said):
        plain(**changes)


def test_flights_that_stand_still_are_made_one_by_one():
    still = plain(speed_mps=0.0)
    assert [flight.segments[0].kind for flight in still] == ["hold"] * 2


def legs_of(number):
    """Of all kinds, and as many as the number tells; some last no time, some stand still."""
    between = [
        Turn.model_construct(duration_s=7.5, speed_mps=40.0, climb_mps=1.0, rate_deg_s=-3.0),
        Straight.model_construct(duration_s=3.1, speed_mps=0.0, climb_mps=-2.0),
        Turn.model_construct(duration_s=2.0, speed_mps=0.0, climb_mps=0.0, rate_deg_s=5.0),
        Straight.model_construct(duration_s=0.0, speed_mps=30.0, climb_mps=0.0),
        Straight.model_construct(duration_s=11.0, speed_mps=60.0, climb_mps=4.0),
    ]  # fmt: skip
    last = Straight.model_construct(duration_s=None, speed_mps=35.0 + number, climb_mps=0.5)
    return [*between[number % 2 : number], last]


def test_turns_and_scripts_that_are_flown_together_have_the_bits_of_each_alone():
    rng = np.random.default_rng(5)
    lat, lon, alt, heading = rng.uniform(
        [[-90], [-180], [0], [0]], [[90], [180], [9e3], [6]], (4, 12)
    )
    lat[:3] = 90.0, -90.0, 0.0
    motion = rng.uniform(5, 90, 12), rng.normal(0, 3, 12), rng.uniform(0.02, 0.2, 12)
    motion[2][::2] *= -1.0
    columns = lat, lon, alt, heading, *motion
    alone = [turn_parameters(*row) for row in zip(*(of.tolist() for of in columns), strict=True)]
    assert turn_parameters(*columns).tobytes() == np.stack(alone, axis=1).tobytes()
    legs = [legs_of(number % 6) for number in range(12)]
    together = segments_of_each((lat, lon, alt), np.radians(np.degrees(heading) % 360.0), legs)
    for k, segments in enumerate(together):
        flight = ScriptedTrajectory(
            "a", lat_deg=lat[k], lon_deg=lon[k], alt_m=alt[k], speed_mps=1.0,
            heading_deg=float(np.degrees(heading[k])), legs=legs[k],
        )  # fmt: skip
        assert len(segments) == len(flight.segments)
        for one, other in zip(segments, flight.segments, strict=True):
            assert one.parameters.tobytes() == other.parameters.tobytes()
            for name in ("kind", "start_s", "pitch_rad", "roll_rad", "speed_mps"):
                assert getattr(one, name) == getattr(other, name)
