"""Changing one part of a scene leaves every other block's draws, and so its detections, alone."""

import pytest

TRAFFIC = """
extends = "{configs}/detect_and_sense.toml"
duration_s = 80
seed = 7

[blocks.radar]
scan_rate_hz = 5
type = "radar.swerling"

[blocks.eo]
scan_rate_hz = 8
offset_s = 0.013

[blocks.ir]
scan_rate_hz = 2
offset_s = 0.2

[blocks.traffic]
type = "traffic.scripted"
ownship = {{ lat_deg = 52.0, lon_deg = 4.4, alt_m = 1000, heading_deg = 0, speed_mps = 50 }}
"""
INTRUDER = """
[[blocks.traffic.intruders]]
name = "{name}"
extends = "{configs}/aircraft/{aircraft}.toml"
east_m = {east_m}
north_m = 9000
up_m = 30
heading_deg = 190
speed_mps = 60
"""


@pytest.fixture
def scene(lab):
    """Return a function that writes the scene with some intruders, without some sensors."""

    def write(names=("first", "second"), without=()):
        text = TRAFFIC.format(configs=lab.configs)
        for name in names:
            east_m, aircraft = {
                "first": (60, "general_aviation"),
                "second": (900, "small_fighter"),
                "third": (-500, "f_16"),
                "alpha": (300, "beech_99"),
            }[name]
            text += INTRUDER.format(
                name=name, configs=lab.configs, aircraft=aircraft, east_m=east_m
            )
        path = lab.folder / "scene.toml"
        if without:
            wires = ['"traffic -> transform -> gate"', '"fusion -> tracker"']
            for sensor in {"radar", "eo", "ir"} - set(without):
                wires += [f'"gate -> {sensor} -> fusion"']
            base = (lab.configs / "detect_and_sense.toml").read_text(encoding="utf-8")
            base = base.replace("sensors/", f"{lab.configs}/sensors/")
            head = base[base.index("[blocks.transform]") :]
            for sensor in without:
                start = head.index(f"[blocks.{sensor}]")
                head = head[:start] + head[head.index("[blocks.", start + 1) :]
                start = text.index(f"[blocks.{sensor}]")
                text = text[:start] + text[text.index("[blocks.", start + 1) :]
            (lab.folder / "base.toml").write_text(
                f"wires = [{', '.join(wires)}]\n{head}", encoding="utf-8"
            )
            text = text.replace(f"{lab.configs}/detect_and_sense.toml", "base.toml")
        path.write_text(text, encoding="utf-8")
        return path

    return write


def detections(lab, run, *, blocks=("radar", "eo", "ir"), targets=("first", "second")):
    """Return, per block, all that was recorded of some targets."""
    found = {}
    for block in blocks:
        rows = lab.rows(run.tables, block, "detections")
        found[block] = [
            {name: value for name, value in row.items() if name != "tick"}
            for row in rows
            if row["target"] in targets
        ]
    assert all(found.values())
    return found


@pytest.fixture
def plain(lab, scene):
    run = lab.run(scene())
    found = detections(lab, run)
    # A radar that detects always or never would make these tests empty.
    scans = [row for row in lab.rows(run.tables, "radar", "scans") if row["evaluated"]]
    share = len(found["radar"]) / sum(row["evaluated"] for row in scans)
    assert 0.2 < share < 0.98
    return found


@pytest.mark.parametrize("names", [("first", "second", "third"), ("alpha", "first", "second")])
def test_adding_a_target(lab, scene, plain, names):
    run = lab.run(scene(names))
    assert detections(lab, run) == plain
    assert len(detections(lab, run, targets=names)["radar"]) > len(plain["radar"])


def test_the_order_of_the_targets(lab, scene, plain):
    assert detections(lab, lab.run(scene(("second", "first")))) != {}
    again = detections(lab, lab.run(scene(("second", "first"))))
    for block, rows in again.items():
        key = [(row["scan"], row["target"]) for row in plain[block]]
        assert sorted(key) == sorted((row["scan"], row["target"]) for row in rows)
        assert all(row in rows for row in plain[block])


@pytest.mark.parametrize("sensor", ["radar", "eo", "ir"])
def test_removing_a_sensor(lab, scene, plain, sensor):
    others = [name for name in ("radar", "eo", "ir") if name != sensor]
    run = lab.run(scene(without=(sensor,)))
    assert detections(lab, run, blocks=others) == {name: plain[name] for name in others}


@pytest.mark.parametrize(
    "change",
    [
        {"sets": ["blocks.fusion.coincidence_s=0.3"]},
        {"sets": ["blocks.tracker.drop_after_s=0.5"]},
        {"swaps": ["fusion=fusion_stand_in:LastSensor"]},
        {"swaps": ["tracker=fusion_stand_in:Forgetful"]},
    ],
)
def test_another_fusion_or_tracker(lab, scene, plain, change, stand_ins):
    assert detections(lab, lab.run(scene(), **change)) == plain


@pytest.fixture
def stand_ins(monkeypatch):
    """A fusion and a tracker from outside the repository, one scan at a time."""
    import sys
    import types

    from components.fusion.pick_best import PickBest
    from components.tracking.stub import TrackerStub

    class LastSensor(PickBest):
        windowed = False

    class Forgetful(TrackerStub):
        windowed = False

        def run(self, wake):
            self.stream("detection").uniform(0, wake.scans)  # draws of its own
            self.setup()
            return super().run(wake)

    module = types.ModuleType("fusion_stand_in")
    module.LastSensor, module.Forgetful = LastSensor, Forgetful
    monkeypatch.setitem(sys.modules, "fusion_stand_in", module)


def test_switching_a_sensor_off_and_changing_another_rate(lab, scene, plain):
    run = lab.run(scene(), sets=["blocks.ir.enabled=false", "blocks.eo.scan_rate_hz=3"])
    assert detections(lab, run, blocks=["radar"]) == {"radar": plain["radar"]}


def test_window_and_grain_of_the_chain(lab, scene):
    short = {"sets": ["duration_s=40"]}
    whole = lab.run(scene(), **short)
    assert whole.tables["detections"].num_rows > 50
    for window in (1, 7):
        again = lab.run(scene(), window=window, shuffle_ties=window, **short)
        assert again.tables == whole.tables


def test_another_seed_changes_who_draws_and_nobody_else(lab, scene, plain):
    again = detections(lab, lab.run(scene(), seed=8))
    assert again["radar"] != plain["radar"] and again["eo"] != plain["eo"]
    silent = [f"blocks.{camera}.noise_equivalent_contrast=0" for camera in ("eo", "ir")]
    one, other = (detections(lab, lab.run(scene(), seed=n, sets=silent)) for n in (7, 8))
    assert one["radar"] != other["radar"]
    assert one["eo"] == other["eo"] and one["ir"] == other["ir"]
