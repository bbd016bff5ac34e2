"""The radar blocks: sampled fluctuation against Pd, tables over aspect, windows, bad parameters."""

import math

import numpy as np
import pytest

from components.aircraft.aircraft import Aircraft, Roster
from components.messages.targets import RelativeTargets
from components.radar.detection import detection_probability
from components.radar.swerling import SwerlingParameters, SwerlingRadar
from components.radar.threshold_radar import ThresholdParameters, ThresholdRadar
from components.sensor.look import Cells
from dsa_des.block.component import Context
from dsa_des.errors import SceneError
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams

RADAR = {
    "scan_rate_hz": 1,
    "power_w": 2.5,
    "antenna_gain_db": 29.5,
    "wavelength_m": 8.57e-3,
    "bandwidth_hz": 486.0,
    "false_alarm_probability": 0.01,
}


def make(cls=SwerlingRadar, parameters=SwerlingParameters, **changes):
    return cls("radar", parameters(**{**RADAR, **changes}), Context(Streams(12)))


def cells_of(crafts, scans, *, range_m=6000.0, heading=math.pi, pitch=0.0, roll=0.0, elevation=0.0):
    """Cells of level targets that come towards us, one per scan and target."""
    shape = (scans, len(crafts))
    azimuth = np.zeros(shape)
    roster = Roster.from_pairs([(f"target {i}", craft) for i, craft in enumerate(crafts)])
    targets = RelativeTargets(
        tick=np.arange(scans),
        azimuth_rad=azimuth,
        elevation_rad=np.broadcast_to(elevation, shape).copy(),
        range_m=np.broadcast_to(range_m, shape).copy(),
        body_azimuth_rad=azimuth,
        body_elevation_rad=azimuth,
        relative_heading_rad=np.broadcast_to(heading, shape).copy(),
        target_pitch_rad=np.broadcast_to(pitch, shape).copy(),
        target_roll_rad=np.broadcast_to(roll, shape).copy(),
        own_alt_m=np.zeros(scans),
        alt_m=azimuth,
        present=np.ones(shape, dtype=bool),
        roster=roster,
        columns=np.arange(len(crafts)),
    )
    rows = np.arange(scans)
    return Cells(targets, rows, targets.present, rows)


SCANS = 40_000


@pytest.mark.parametrize("pulses", [1, 4])
@pytest.mark.parametrize("model", [0, 1, 2, 3, 4])
def test_sampled_fluctuation_detects_with_the_models_probability(model, pulses):
    """Thesis eq. 22-23 and errata 18: the share of detections is Pd, within 4 sigma."""
    craft = Aircraft(swerling=model, rcs_dbsm=3.0)
    sampled = make(fluctuation="sampled", pulses=pulses)
    mean = make(pulses=pulses)
    cells = cells_of([craft], SCANS, range_m=9000.0 * pulses**0.25)
    snr = mean.snr(cells)
    exact = detection_probability(
        snr[0], pulses=pulses, false_alarm_probability=0.01, model=f"swerling{model}"
    )
    assert 0.2 < exact < 0.99
    sigma = math.sqrt(exact * (1.0 - exact) / SCANS)
    look = sampled.look(cells)
    assert abs(look.detected.mean() - exact) < 4.0 * sigma
    # The probabilities that were drawn against scatter less than the detections do.
    drawn = look.extras["detection_probability"]
    assert abs(drawn.mean() - exact) <= 4.0 * drawn.std() / math.sqrt(SCANS) + 1e-15
    assert (drawn.std() > 0.03) == (model != 0)
    # The other way to the same share.
    assert abs(mean.look(cells).detected.mean() - exact) < 4.0 * sigma
    # The SNR of the scans has the model's mean.
    seen = np.power(10.0, look.extras["snr_db"] / 10.0)
    spread = {0: 0.0, 1: 1.0, 2: 1.0 / pulses, 3: 0.5, 4: 0.5 / pulses}[model]
    assert seen.mean() == pytest.approx(snr[0], rel=4.0 * math.sqrt(spread / SCANS) + 1e-12)
    assert seen.var() == pytest.approx(spread * snr[0] ** 2, rel=0.08, abs=1e-20)


def test_mixed_models_draw_as_if_each_target_were_alone():
    crafts = [Aircraft(swerling=model) for model in (4, 1, 0, 2, 3, 1)]
    radar = make(fluctuation="sampled", pulses=3)
    together = cells_of(crafts, 50)
    whole = radar.look(together)
    for index, craft in enumerate(crafts):
        alone = cells_of([craft], 50)
        # Draws are keyed by the target's name.
        alone.roster = Roster.from_pairs([(f"target {index}", craft)])
        look = radar.look(alone)
        chosen = together.target == index
        for name in ("snr_db", "detection_probability"):
            assert look.extras[name].tobytes() == whole.extras[name][chosen].tobytes()
        np.testing.assert_array_equal(look.detected, whole.detected[chosen])


RCS_TABLE = "az_deg,el_deg,dbsm\n" + "".join(
    f"{az},{el},{nose}\n"
    for el in (-90, 0, 90)
    for az, nose in ((0, 3), (90, 20), (180, -5), (270, 10))
).replace(",0,10", ",0,11")


@pytest.fixture
def rcs_file(tmp_path):
    path = tmp_path / "rcs.csv"
    path.write_text(RCS_TABLE, encoding="utf-8")
    return path


# relative heading, pitch, roll, elevation (deg), dBsm; from where the radar sees it
ASPECTS = [
    ((180, 0, 0, 0), 3.0, "head-on"),
    ((0, 0, 0, 0), -5.0, "flies away"),
    ((90, 0, 0, 0), 20.0, "crosses to the right: its right wing shows"),
    ((-90, 0, 0, 0), 11.0, "crosses to the left: its left wing shows"),
    ((135, 0, 0, 0), 11.5, "half-way between nose and right wing"),
    ((180, 30, 0, -30), 3.0, "climbs straight at us"),
    ((90, 0, 30, -30), 20.0, "its right wing dips straight at us"),
]


@pytest.mark.parametrize(("attitude", "dbsm", "what"), ASPECTS)
def test_rcs_follows_the_aspect(attitude, dbsm, what, rcs_file):
    heading, pitch, roll, elevation = np.radians(attitude)
    view = {"heading": heading, "pitch": pitch, "roll": roll, "elevation": elevation}
    crafts = [Aircraft(rcs_table=rcs_file), Aircraft(rcs_dbsm=dbsm), Aircraft(rcs_table=rcs_file)]
    for radar in (make(), make(ThresholdRadar, ThresholdParameters)):
        snr = radar.snr(cells_of(crafts, 3, **view)).reshape(3, 3)
        np.testing.assert_allclose(snr[:, 0], snr[:, 1], rtol=1e-12)
        np.testing.assert_array_equal(snr[:, 0], snr[:, 2])
    assert Aircraft(rcs_table=rcs_file).rcs_table.table is crafts[0].rcs_table.table


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "rcs.csv: there is no such file"),
        ("az_deg,el_deg,dbsm\n0,0,1\n90,0,1\n0,10,1\n", "hole: no value at az_deg 90, el_deg 10"),
        ("az_deg,el_deg,dbsm\n0,0,nan\n", "dbsm is nan"),
        (b"\xff\xfe\x00", "not a text file in UTF-8"),
    ],
)
def test_a_bad_table_is_a_problem_of_the_scene(configs, tmp_path, text, message):
    path = tmp_path / "scene.toml"
    path.write_text(
        f'extends = "{configs / "first_light.toml"}"\n'
        '[[blocks.traffic.intruders]]\nname = "a"\nrcs_table = "rcs.csv"\n'
        "east_m = 100\nnorth_m = 9000\n",
        encoding="utf-8",
    )
    if isinstance(text, bytes):
        (tmp_path / "rcs.csv").write_bytes(text)
    elif text is not None:
        (tmp_path / "rcs.csv").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (problem,) = caught.value.problems
    assert "rcs_table" in problem.key and message in str(problem)
