"""A host that calls at the scan instants gets what the scene gives when it is run whole."""

import numpy as np
import pytest

from components.messages.detections import Detections

#: The first intruder so near that every sensor sees it at once.
NEAR = ("blocks.traffic.intruders[0].north_m=1000",)


def _recorded(results, table):
    """Return the rows of a table as dictionaries, from what blocks sent to the host."""
    rows = []
    for result in results:
        for block, message in sorted(result.messages.items()):
            columns = message.tables().get(table)
            if columns is None:
                continue
            for i in range(len(columns["tick"])):
                row = {"block": block}
                for name, values in columns.items():
                    if hasattr(values, "names"):
                        code = values.codes[i]
                        row[name] = None if code < 0 else values.names[code]
                    else:
                        value = values[i].item()
                        row[name] = None if value != value else value
                rows.append(row)
    return rows


def _assert_same(results, tables, table):
    ours = _recorded(results, table)
    theirs = tables[table].to_pylist()
    assert len(ours) == len(theirs) > 0
    for row, expected in zip(ours, theirs, strict=True):
        for name, value in row.items():
            if name != "skipped_culled":
                assert value == expected[name], (name, row, expected)


@pytest.mark.parametrize(
    ("sets", "end_s"),
    [
        ((), 12),
        # Memory of the last look, rules over many looks, draws of every kind, late blocks.
        (
            (
                "blocks.eo.dynamic_weight=0.5",
                "blocks.radar.declare_m=2",
                "blocks.radar.declare_n=3",
                "blocks.ir.jitter_s=0.01",
                "blocks.eo.rate_error_ppm=20",
                "blocks.fusion.coincidence_s=0.06",
                "weather.rain_rate_mm_h=5",
                "navigation.position_noise_m=[5, 5, 5]",
                "blocks.traffic.intruders[1].start_time_s=4",
            ),
            8,
        ),
        (
            (
                "blocks.radar.fluctuation='sampled'",
                "blocks.radar.false_alarms=true",
                "blocks.radar.false_alarm_probability=1e-7",
                "blocks.eo.false_alarms_per_frame=0.1",
            ),
            12,
        ),
    ],
    ids=["plain", "memory", "sampled"],
)
def test_detections_are_the_same_to_the_bit(configs, flying, sets, end_s):
    scene = configs / "first_light.toml"
    host = flying.Host(scene, sets=sets)
    simulator = flying.Simulator(scene, sets=sets, beyond_fusion=True)
    host.add_planes(simulator)
    results = flying.fly(simulator, host, end_s)
    tables = flying.run_whole(scene, sets=(*sets, f"duration_s={end_s}"))
    for table in ("detections", "fused", "tracks", "scans"):
        _assert_same(results, tables, table)


def test_false_alarms_belong_to_no_plane(configs, flying):
    scene = configs / "first_light.toml"
    sets = ("blocks.eo.false_alarms_per_frame=0.5",)
    host = flying.Host(scene, sets=sets)
    together, apart = (flying.Simulator(scene, sets=sets) for _ in range(2))
    for simulator in (together, apart):
        host.add_planes(simulator)
    found = [alarm for result in flying.fly(together, host, 5.0) for alarm in result.false_alarms]
    tables = flying.run_whole(scene, sets=(*sets, "duration_s=5"))
    alone = [row for row in tables["fused"].to_pylist() if row["target"] is None]
    assert [alarm.azimuth_rad for alarm in found] == [row["azimuth_rad"] for row in alone]
    assert 20 < len(found) < 80
    assert {alarm.sensors for alarm in found} == {("eo",)}

    def one(simulator, states, time_s, i):
        return simulator.simulate(*states[:2], states[2][i], states[3][i], time_s, plane=i)

    parts = flying.fly(apart, host, 5.0, plane=one)
    assert not any(result.false_alarms for results in parts for result in results)


def test_the_answer_is_that_of_the_fusion(configs, flying):
    scene = configs / "first_light.toml"
    host = flying.Host(scene, sets=NEAR)
    simulator = flying.Simulator(scene, sets=NEAR)
    host.add_planes(simulator)
    seen = [
        (result.time_s, sighting)
        for result in flying.fly(simulator, host, 8.0)
        for sighting in result
        if sighting.detected
    ]
    fused = flying.run_whole(scene, sets=(*NEAR, "duration_s=8"))["fused"].to_pylist()
    assert any(row["sensors"] == "radar+eo+ir" for row in fused)
    order = {name: place for place, name in enumerate(simulator.planes)}
    fused.sort(key=lambda row: (row["tick"], order[row["target"]]))
    assert len(seen) == len(fused) > 100
    for (time_s, sighting), row in zip(seen, fused, strict=True):
        assert (time_s, sighting.name) == (row["time_s"], row["target"])
        assert "+".join(sighting.sensors) == row["sensors"]
        assert set(sighting.confidence) == set(sighting.sensors)
        assert sighting.azimuth_rad == row["azimuth_rad"]
        assert sighting.elevation_rad == row["elevation_rad"]
        assert (sighting.range_m == row["range_m"]) or (
            np.isnan(sighting.range_m) and row["range_m"] is None
        )


def test_a_call_for_each_plane_gives_what_one_call_for_all_gives(configs, flying):
    scene = configs / "first_light.toml"
    # With memory of the last look: each plane's call must find its own.
    sets = (*NEAR, "blocks.ir.dynamic_weight=0.5")
    host = flying.Host(scene, sets=NEAR)
    together, apart = (flying.Simulator(scene, sets=sets) for _ in range(2))
    for simulator in (together, apart):
        host.add_planes(simulator)

    def one(simulator, states, time_s, i):
        own_lla, own_att, lla, att = states
        name = simulator.planes[i]
        return simulator.simulate(own_lla, own_att, lla[i], att[i], time_s, plane=name)

    whole = flying.fly(together, host, 6.0)
    parts = flying.fly(apart, host, 6.0, plane=one)
    assert len(whole) == len(parts)
    for result, results in zip(whole, parts, strict=True):
        for i, single in enumerate(results):
            assert single.scans == result.scans
            assert len(single) == 1
            assert repr(single[0]) == repr(result[i])
    assert any(sighting.detected for result in whole for sighting in result)
    with pytest.raises(ValueError, match="not both"):
        together.simulate(*host.at(50.0), 50.0, plane="head_on")


def test_radians_rounded_anyhow_give_the_same_reports(configs, flying):
    """A host that converts degrees in the plain way gets the same grid points."""
    scene = configs / "first_light.toml"
    host = flying.Host(scene, sets=NEAR)
    simulator = flying.Simulator(scene, sets=NEAR)
    host.add_planes(simulator)
    expected = flying.run_whole(scene, sets=(*NEAR, "duration_s=8"))["detections"].to_pylist()
    assert {row["block"] for row in expected} == {"eo", "ir", "radar"}
    found = []
    time_s = simulator.next_scan_s()
    while time_s < 8.0:
        own_lla, own_att, lla, att = host.at(time_s)
        for array in (own_lla, lla):
            array[..., :2] = np.radians(np.degrees(array[..., :2]))
        result = simulator.simulate(own_lla, own_att, lla, att, time_s)
        for block, message in sorted(result.messages.items()):
            if isinstance(message, Detections):
                names = [message.roster.names[i] for i in message.target]
                found += list(
                    zip([block] * len(names), names, message.azimuth_rad.tolist(), strict=True)
                )
        time_s = simulator.next_scan_s()
    assert found == [(row["block"], row["target"], row["azimuth_rad"]) for row in expected]
