"""The yardstick is the same physics: it finds the engine's detections, fused targets and angles."""

import pytest

from components.benchmark import yardstick
from components.benchmark.scenes import CASES, load_case_scene, random_phase_replicas
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation

SHORT = {
    "thesis": "300", "clocks": "60", "hundred": "60", "ten_thousand": "1", "sparse": "1",
    "monte_carlo": "60", "manoeuvres": "90",
}  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_yardstick_finds_the_same(case):
    scene = load_case_scene(case, quick=False, duration_s=SHORT[case.name])
    if case.replicas:
        scene = random_phase_replicas(scene, 2)[1]
    sink = MemorySink()
    simulation = Simulation(scene, recorder=Recorder([sink]))
    simulation.run()
    tables = sink.tables()
    plain = yardstick.run(yardstick.prepare_plain_loop(simulation))
    rows = tables["detections"].to_pydict()
    place = {name: i for i, name in enumerate(simulation.components["traffic"].roster.names)}
    found = {
        (block, scan, place[target]): (azimuth, elevation)
        for block, scan, target, azimuth, elevation in zip(
            *(rows[k] for k in ("block", "scan", "target", "azimuth_rad", "elevation_rad")),
            strict=True,
        )
    }
    assert found
    assert found.keys() == plain.detections.keys()
    for key, (azimuth, elevation) in found.items():
        assert plain.detections[key][:2] == pytest.approx((azimuth, elevation), abs=1e-9)
    assert plain.fused == tables["fused"].num_rows


def test_the_replicas_of_the_benchmark_run_together_and_share_their_blocks():
    """With other phases of three clocks; no truth is recorded of so many."""
    from components.benchmark.scenes import load_case_scene, random_phase_replicas, select_cases
    from dsa_des.replicas.lockstep import make_lockstep_simulation

    (case,) = select_cases(["monte_carlo"])
    scene = load_case_scene(case, quick=False, duration_s="2")
    simulation = make_lockstep_simulation(random_phase_replicas(scene, 3))
    assert not simulation.timeline.split
