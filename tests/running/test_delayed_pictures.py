"""What sensors, fusion and tracker see when messages take their time, against sums by hand.

A radar at rest looks at a target that flies straight away from it at 100 m/s, so a range tells of
which instant the picture was: 2000 m and 100 m for every second.
"""

import itertools

import numpy as np
import pytest

from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams

WIRES = (
    ("traffic", "transform"),
    ("transform", "gate"),
    ("gate", "radar"),
    ("radar", "fusion"),
    ("fusion", "tracker"),
)
SCENE = """
duration_s = 4
seed = 11
wires = [{wires}]
{head}
[blocks]
{blocks}
"""
AWAY = '{ name = "away", east_m = 0, north_m = 2000, up_m = 0, heading_deg = 0, speed_mps = 100 }'
BLOCKS = {
    "traffic": 'type = "traffic.scripted"\n'
    "ownship = { lat_deg = 0, lon_deg = 0, alt_m = 1000, heading_deg = 0, speed_mps = 0 }\n"
    f"intruders = [ {AWAY} ]",
    "transform": 'type = "geometry.ellipsoid"',
    "gate": 'type = "gate"',
    "radar": 'type = "radar.range_boundary"\nscan_rate_hz = 5\nrange_km = 10',
    "fusion": 'type = "fusion.pick_best"',
    "tracker": 'type = "tracking.stub"',
}
PERIOD_S = 0.2
# The Earth curves away under the straight flight, and a sphere's degree is not the ellipsoid's.
CLOSE_M = 2.0
SPEED_MPS = 100.0


def scene(folder, options=None, sets=(), head="", backwards=False, tables=BLOCKS):
    """Return the scene; `options` by (source, target) are text for the wire's table."""
    given = options or {}
    wires = [f'{{ from = "{a}", to = "{b}"{given.get((a, b), "")} }}' for a, b in WIRES]
    names = list(tables)
    if backwards:
        wires, names = wires[::-1], names[::-1]
    blocks = "\n".join(f"[blocks.{name}]\n{tables[name]}" for name in names)
    path = folder / "scene.toml"
    path.write_text(SCENE.format(wires=", ".join(wires), head=head, blocks=blocks), "utf-8")
    return load_scene(path, sets=list(sets))


def run(loaded, **options):
    sink = MemorySink()
    Simulation(loaded, recorder=Recorder([sink]), **options).run()
    return sink.tables()


def seen(tables):
    """Return the instants of the radar's detections, and of what instant their ranges speak."""
    columns = tables["detections"].to_pydict()
    of_s = (np.array(columns["true_range_m"]) - 2000.0) / SPEED_MPS
    return np.array(columns["time_s"]), of_s


@pytest.mark.parametrize(
    ("sets", "options", "delay_s"),
    [
        ([], {}, 0.0),
        (["blocks.traffic.latency_s=0.25"], {}, 0.25),
        (["blocks.transform.latency_s=0.25"], {}, 0.25),
        (["blocks.gate.latency_s=0.25"], {}, 0.25),
        ([], {("traffic", "transform"): ", delay_s = 0.5"}, 0.5),
        ([], {("gate", "radar"): ', delay = "2 scans"'}, 0.4),
        (
            ["blocks.traffic.latency_s=0.1", "blocks.transform.latency_s=0.2"],
            {("gate", "radar"): ', delay = "1 scan"', ("transform", "gate"): ", delay_s = 0.05"},
            0.55,
        ),
    ],
)
def test_a_sensor_sees_the_picture_as_old_as_its_way(tmp_path, sets, options, delay_s):
    loaded = scene(tmp_path, options, sets)
    time_s, of_s = seen(run(loaded))
    scans = np.arange(20) * PERIOD_S
    assert np.allclose(time_s, scans[scans > delay_s - 1e-9])  # before there is nothing to see
    assert np.allclose(of_s, time_s - delay_s, atol=CLOSE_M / SPEED_MPS)


def test_a_picture_published_at_a_rate_arrives_late_too(tmp_path):
    sets = ["blocks.traffic.update_rate_hz=2", "blocks.transform.latency_s=0.3"]
    time_s, of_s = seen(run(scene(tmp_path, sets=sets)))
    published = np.floor((time_s - 0.3 + 1e-9) / 0.5) * 0.5
    assert np.allclose(of_s, published, atol=CLOSE_M / SPEED_MPS)


def test_of_late_and_lost_pictures_the_last_to_arrive_counts(tmp_path):
    options = {("traffic", "transform"): ", delay_s = 0.1, jitter_s = 0.7, drop_probability = 0.2"}
    tables = run(scene(tmp_path, options))
    time_s, of_s = seen(tables)
    # Asked for at the scans less the delay that is sure; each row has a fate of its own.
    sent = np.array([round((k * PERIOD_S - 0.1) * 1e9) for k in range(1, 20)], dtype=np.int64)
    stream = Streams(11).stream("traffic.states -> transform.states", "wire jitter")
    late = np.rint(stream.uniform(sent.astype(np.uint64), 0) * 0.7e9).astype(np.int64)
    losses = Streams(11).stream("traffic.states -> transform.states", "wire loss")
    kept = losses.uniform(sent.astype(np.uint64), 0) >= 0.2
    arrivals = sorted(
        (int(tick + 10**8 + extra), int(tick))
        for tick, extra, there in zip(sent, late, kept, strict=True)
        if there
    )
    wanted = {}
    for k in range(20):
        come = [tick for arrival, tick in arrivals if arrival <= k * 2 * 10**8]
        if come:
            wanted[k * PERIOD_S] = come[-1] / 1e9
    assert np.allclose(time_s, list(wanted))
    assert np.allclose(of_s, list(wanted.values()), atol=CLOSE_M / SPEED_MPS)
    assert any(b < a for a, b in itertools.pairwise(of_s)), "no picture was overtaken"


def test_a_processor_before_the_radar_shows_it_the_scan_before(tmp_path):
    sets = ["blocks.transform.processor=cpu", "processors.cpu.service_s=0.05"]
    time_s, of_s = seen(run(scene(tmp_path, sets=sets)))
    assert np.allclose(time_s, np.arange(1, 20) * PERIOD_S)
    assert np.allclose(of_s, time_s - PERIOD_S, atol=CLOSE_M / SPEED_MPS)


@pytest.mark.parametrize("delay_s", [0, 0.25])
def test_a_beam_goes_on_from_the_instant_of_the_picture(tmp_path, delay_s):
    sweeping = {**BLOCKS, "radar": BLOCKS["radar"] + "\nbeam_sweep = true"}
    loaded = scene(tmp_path, sets=[f"blocks.gate.latency_s={delay_s}"], tables=sweeping)
    columns = run(loaded)["detections"].to_pydict()
    lit_s = np.array(columns["illuminated_s"])
    of_s = (np.array(columns["true_range_m"]) - 2000.0) / SPEED_MPS
    assert len(lit_s) > 10 and (lit_s - np.array(columns["time_s"]) > 0.05).all()
    assert np.allclose(of_s, lit_s - delay_s, atol=CLOSE_M / SPEED_MPS)


def test_what_the_ownship_believes_is_of_the_instant_of_the_picture(tmp_path):
    """White noise is keyed by the instant of the states: the late row brings its own."""
    head = "[navigation]\nposition_noise_m = [5, 5, 5]"
    here = run(scene(tmp_path, head=head))["scans"].to_pydict()
    late = run(scene(tmp_path, {("gate", "radar"): ', delay = "1 scan"'}, head=head))
    assert late["scans"].to_pydict()["own_lat_deg"] == here["own_lat_deg"][:-1]


def test_a_tracker_is_updated_when_the_measurement_has_come(tmp_path):
    prompt = run(scene(tmp_path))
    late = run(scene(tmp_path, sets=["blocks.fusion.latency_s=0.1"]))
    assert late["fused"].equals(prompt["fused"])
    tracks, before = late["tracks"].to_pydict(), prompt["tracks"].to_pydict()
    assert tracks["tick"] == [tick + 10**8 for tick in before["tick"]]
    for column in ("target", "range_m", "azimuth_rad", "updated_by"):
        assert tracks[column] == before[column]
    assert set(tracks["age_s"]) == {0.1}  # from when it was measured
    assert tracks["measured_s"] == before["time_s"]


def test_ages_count_from_when_a_measurement_was_made(tmp_path):
    """A second target leaves the radar's reach: from then on its track grows old."""
    leaves = AWAY.replace("away", "leaves").replace("2000", "9900")
    two = {**BLOCKS, "traffic": BLOCKS["traffic"].replace(AWAY, f"{AWAY}, {leaves}")}
    tables = run(scene(tmp_path, sets=["blocks.fusion.latency_s=0.3"], tables=two))
    rows = [row for row in tables["tracks"].to_pylist() if row["target"] == "leaves"]
    last = max(row["measured_s"] for row in rows)
    assert last == pytest.approx(1.0)  # 10 km away after 1 s
    left = [row for row in rows if row["time_s"] > last + 0.3]
    assert len(left) > 5
    assert np.allclose([r["age_s"] for r in left], [r["time_s"] - last for r in left])


KITCHEN = {
    "jitter on every wire": dict.fromkeys(WIRES, ", jitter_s = 0.3"),
    "loss on every wire": dict.fromkeys(WIRES, ", drop_probability = 0.3"),
    "delay on every wire": {
        wire: f", delay_s = {delay}"
        for wire, delay in zip(WIRES, (0.05, '"1/3"', 0.2, 0.001, 0.7), strict=True)
    },
    "all of it": dict.fromkeys(WIRES, ", delay_s = 0.05, jitter_s = 0.3, drop_probability = 0.2"),
}
LATENCIES = [f"blocks.{name}.latency_s=0.03" for name in BLOCKS]


@pytest.mark.parametrize("what", KITCHEN)
@pytest.mark.parametrize(
    "sets",
    [
        [],
        LATENCIES,
        ["blocks.traffic.update_rate_hz=7", "blocks.radar.jitter_s=0.02"],
        ["processors.cpu.service_s=0.02", *(f"blocks.{name}.processor=cpu" for name in BLOCKS)],
    ],
    ids=["plain", "latencies", "published", "processor"],
)
def test_grain_and_order_change_nothing(tmp_path, what, sets):
    loaded = scene(tmp_path, KITCHEN[what], sets)
    wanted = run(loaded, window=1)
    assert wanted["scans"].num_rows > 3
    ways = [
        run(loaded),
        run(loaded, window=3),
        run(loaded, window=5, shuffle_ties=4),
        run(scene(tmp_path, KITCHEN[what], sets, backwards=True)),
    ]
    for tables in ways:
        for name, table in wanted.items():
            assert tables[name].equals(table), name
