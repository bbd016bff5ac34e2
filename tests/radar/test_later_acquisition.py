"""A radar acquires slow targets, and those off the nose, later than it keeps them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import wired
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of

import dsa_des
from components.sensor.acquisition import Acquired, AcquisitionRange

KIND = "radar.range_boundary"
RANGES = [
    {"below_m_s": 51.4, "range_km": 10.0, "azimuth_deg": [0, 30, 60], "share": [1, 0.67, 0.45]},
    {"below_m_s": 66.9, "range_km": 11.1, "azimuth_deg": [0, 30, 60], "share": [1, 0.78, 0.52]},
    {"range_km": 12.4, "azimuth_deg": [0, 30, 60], "share": [1, 0.84, 0.6]},
]
OWNSHIP = {"lat_deg": -41.3, "lon_deg": 173.2, "alt_m": 2400.0, "heading_deg": 217.0,
           "speed_mps": 50.0, "yaw_deg": 217.0, "roll_deg": 0.0}  # fmt: skip


def coming(name: str, off_deg: float, speed_mps: float, from_m: float = 13e3) -> dict:
    """One whose bearing from the ownship stays as it is while it comes nearer."""
    own = math.radians(217.0)
    bearing = own + math.radians(off_deg)
    # Across the line of sight it goes with the ownship, along it towards it.
    across = 50.0 * math.sin(own - bearing)
    along = -math.sqrt(speed_mps**2 - across**2)
    north = along * math.cos(bearing) - across * math.sin(bearing)
    east = along * math.sin(bearing) + across * math.cos(bearing)
    return {
        "name": name, "north_m": from_m * math.cos(bearing), "east_m": from_m * math.sin(bearing),
        "up_m": 90.0, "heading_deg": math.degrees(math.atan2(east, north)), "speed_mps": speed_mps,
    }  # fmt: skip


TARGETS = [
    coming("slow_ahead", 0.0, 45.0), coming("slow_right", 45.0, 45.0),
    coming("slow_left", -45.0, 45.0), coming("medium", -30.0, 60.0), coming("fast", 45.0, 90.0),
    coming("aside", 80.0, 55.0, 8e3),
]  # fmt: skip
#: By hand: range by speed, times the share between those of the azimuths beside.
ACQUIRED_KM = {
    "slow_ahead": 10.0, "slow_right": 5.6, "slow_left": 5.6, "medium": 0.78 * 11.1,
    "fast": 0.72 * 12.4, "aside": 0.52 * 11.1,
}  # fmt: skip


def scene(targets, duration_s=150, **keys):
    radar = wired.sensor(KIND, scan_rate_hz=1, range_km=12.4, **{"acquisition": RANGES, **keys})
    return wired.chain({"radar": radar}, ownship=OWNSHIP, targets=targets, duration_s=duration_s)


def first_seen(table) -> dict[str, float]:
    found: dict[str, float] = {}
    for row in table.sort_by("time_s").to_pylist():
        found.setdefault(row["target"], row["true_range_m"] / 1000.0)
    return found


@covers(
    *(f"acquisition.{k}" for k in ("below_m_s", "range_km", "azimuth_deg", "share")), of=(KIND,)
)
def test_targets_are_acquired_by_azimuth_and_speed_and_then_kept():
    table = wired.run(scene(TARGETS))["detections"]
    found = first_seen(table)
    for name, expected in ACQUIRED_KM.items():
        # A second at 140 m/s is the last look before.
        assert expected - 0.14 < found[name] <= expected + 0.01, name
    plain = first_seen(wired.run(scene(TARGETS, acquisition=[]))["detections"])
    assert all(plain[name] > found[name] + 0.9 for name in ACQUIRED_KM)
    for name in ACQUIRED_KM:  # from then on at every scan
        times = table.filter(is_of(table, name))["time_s"].to_pylist()
        assert np.diff(times).tolist() == [1.0] * (len(times) - 1)


def is_of(table, name):
    return [target == name for target in table["target"].to_pylist()]


def test_who_turns_aside_is_kept_and_who_was_lost_is_acquired_anew():
    """One that is overtaken drifts from ahead to the side: kept; beyond the field of view: lost."""
    beside = {"name": "beside", "north_m": -6500.0 * math.cos(math.radians(37.0)),
              "east_m": -6500.0 * math.sin(math.radians(37.0)), "up_m": 0.0, "heading_deg": 127.0,
              "speed_mps": 49.0}  # fmt: skip
    wide = wired.run(scene([beside]))["detections"]
    azimuths = np.degrees(np.abs(wide["true_azimuth_rad"].to_numpy()))
    ranges = wide["true_range_m"].to_numpy() / 1000.0
    share = np.interp(azimuths, [0, 30, 60], [1, 0.67, 0.45])
    assert (ranges > 10.0 * share).sum() > 20 and len(wide) == 150
    narrow = wired.run(scene([beside], azimuth_deg=[-40, 180]))["detections"]
    assert 10 < len(narrow) < 140


def test_windows_and_other_runs_change_nothing():
    loaded = dsa_des.load_scene(scene(TARGETS))
    one = same_in_any_window(loaded, (7,))["detections"]
    slower = {"blocks.traffic.intruders": [coming("slow_ahead", 50.0, 47.0), *TARGETS[1:]]}
    scenes = replicas_of(loaded, {}, slower)
    same_as_alone(scenes)
    assert first_seen(one) != first_seen(tables_of(scenes[1])[1]["detections"])


@pytest.mark.parametrize(("ranges", "said"), [
    ([{"below_m_s": 50.0, "range_km": 9.0}], "the last has none"),
    ([{"below_m_s": 60.0, "range_km": 9.0}, {"below_m_s": 50.0, "range_km": 9.0},
      {"range_km": 9.0}], "must ascend"),
    ([{"range_km": 9.0, "azimuth_deg": [0, 30]}], "azimuth_deg holds 2 values and share 1"),
    ([{"range_km": 9.0, "azimuth_deg": [30, 0], "share": [1, 0.5]}], "ascending angles"),
    ([{"range_km": 9.0, "share": [1.5]}], "share"),
    ([{"range_km": 9.0, "shares": [1.0]}], "did you mean 'share'"),
])  # fmt: skip
def test_what_cannot_be(ranges, said):
    with pytest.raises(dsa_des.errors.SceneError, match="acquisition") as caught:
        table = scene(TARGETS)
        table["blocks"]["radar"]["acquisition"] = ranges
        dsa_des.load_scene(table)
    assert said in str(caught.value)


def test_who_is_missed_or_goes_too_far_is_acquired_anew():
    """Two targets of two runs by hand, in one call and in two that are cut anywhere."""
    scan = np.array([0, 1, 2, 3, 4, 5, 6, 8, 9, 10])
    range_km = np.array([6.0, 4.0, 6.0, 11.0, 6.0, 4.0, 9.0, 6.0, 4.9, 9.9])
    seen = [0, 1, 1, 0, 0, 1, 1, 0, 1, 1]
    other = np.array([9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 4.0, 9.0, 9.0, 4.0])
    of_other = [0, 0, 0, 0, 0, 0, 1, 0, 0, 1]  # scan 7 is missing: anew in scan 10

    def factors(where, first, last):
        part = slice(first, last)
        count = len(scan[part])
        cells = SimpleNamespace(
            run=np.repeat([0, 2], count), target=np.ones(2 * count, dtype=int),
            scan=np.tile(scan[part], 2), roster=SimpleNamespace(names=("a", "b")),
            body_azimuth_rad=np.zeros(2 * count),
            range_m=1000.0 * np.concatenate([range_km[part], other[part]]),
        )  # fmt: skip
        return where(Sized(cells)).reshape(2, -1)

    ranges = (AcquisitionRange(range_km=10.0, share=(0.5,)),)
    for cut in range(1, len(scan)):
        where = Acquired(ranges)
        found = np.concatenate([factors(where, 0, cut), factors(where, cut, None)], axis=1)
        assert found.tolist() == [seen, of_other], cut


class Sized:
    """Cells with nothing but columns."""

    def __init__(self, columns):
        self.__dict__.update(vars(columns))

    def __len__(self):
        return len(self.scan)
