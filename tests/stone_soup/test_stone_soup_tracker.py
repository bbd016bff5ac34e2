"""A tracker of Stone Soup's as a block: what it is given, and what is told of it."""

import re
import subprocess
import sys
from copy import copy
from datetime import datetime
from pathlib import Path

import crooked
import numpy as np
import pytest
from covering import covers
from same_runs import replicas_of, same_as_alone, same_in_any_window, tables_of
from wired import chain, rows, run

import dsa_des
from components.stone_soup.tracker import StoneSoupTracker
from dsa_des.errors import BlockFailure, SceneError
from dsa_des.running.simulation import Simulation

PAGE = Path(__file__).parents[2] / "docs" / "stone-soup.md"
RADAR = {"type": "radar.range_boundary", "scan_rate_hz": 4, "range_km": 20.0, "errors": "stated",
         "quantised": False, "azimuth_error_deg": 0.1, "elevation_error_deg": 0.1,
         "range_error_m": 3.0}  # fmt: skip
CAMERA = {"type": "optical.range_boundary", "scan_rate_hz": 5, "range_km": 20.0, "errors": "stated",
          "quantised": False, "azimuth_error_deg": 0.02, "elevation_error_deg": 0.02}  # fmt: skip

WRONG = (BlockFailure, SceneError)
#: Shows one track with the numbers of its components as its state, and lists what it was given.
FAKE = """
import numpy as np
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track

class Fixed:
    given = []
    track = None

    def update_tracker(self, time, detections):
        self.given.append((time, detections))
        size = {size}
        assert all(d.measurement_model.ndim_state == size for d in detections)
        assert all(d.measurement_model.mapping == {mapping} for d in detections)
        spread = np.diag(np.arange(1.0, {length} + 1))
        state = GaussianState(np.arange({length})[:, None], spread, time)
        if self.track is None:
            self.track = Track([state])
        else:
            self.track.append(state)
        return time, {{self.track}}

def build():
    return Fixed()
"""


@pytest.fixture(autouse=True)
def stone_soup_there():
    pytest.importorskip("stonesoup", reason="needs the extra stonesoup")


def documented(tmp_path):
    """The tracker of the docs."""
    text = re.search(r"<!-- file: my_tracker.py -->\n```python\n(.*?)```", PAGE.read_text(), re.S)
    (tmp_path / "my_tracker.py").write_text(text[1])
    return f"{tmp_path}/my_tracker.py:build"


def scene(builder, duration_s=3, sensors=None, **keys):
    return chain(
        sensors or {"radar": RADAR, "camera": CAMERA}, duration_s=duration_s,
        fusion={"type": "fusion.pass_through"},
        tracker={"type": "tracking.stonesoup", "builder": builder, **keys},
    )  # fmt: skip


@covers("builder", of=("tracking.stonesoup",))
def test_the_users_tracker_follows_the_targets(tmp_path):
    """As it does when it is given the recorded run."""
    from components.export import stone_soup

    one = run(scene(documented(tmp_path)))
    told = rows(one, "state_tracks")
    last = [row for row in told if row["tick"] == max(r["tick"] for r in told)]
    assert {row["track"] for row in last} == {1, 2}
    recorded = stone_soup(one)
    sys.path.append(str(tmp_path))
    try:
        from my_tracker import build
    finally:
        sys.path.remove(str(tmp_path))
        sys.modules.pop("my_tracker", None)
    tracker = build()
    tracker.detector = recorded.detector
    *_, (_, tracks) = tracker
    theirs = sorted(tuple(np.array(t.state_vector, float)[:, 0]) for t in tracks)
    axes = ("east_m", "east_m_s", "north_m", "north_m_s", "down_m", "down_m_s")
    signs = np.array([1, 1, 1, 1, -1, -1])
    ours = sorted(tuple(signs * [row[axis] for axis in axes]) for row in last)
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-6)
    origin = [last[0][f"origin_{c}"] for c in ("lat_deg", "lon_deg", "alt_m")]
    assert origin == pytest.approx(recorded.origin)
    import pymap3d

    for target in crooked.TARGETS:
        true = pymap3d.ecef2ned(*crooked.position(target, last[0]["state_s"]), *origin)
        apart = [np.subtract(true, [row[a] for a in ("north_m", "east_m", "down_m")])
                 for row in last]  # fmt: skip
        assert min(np.linalg.norm(a) for a in apart) < 10.0
    assert {row["contributors"] for row in last} == {"radar+camera"}
    assert {row["has_range"] for row in told} == {True}
    statuses = {row["track_status"] for row in told}
    assert statuses == {"confirmed"}


@covers("position_mapping", "velocity_mapping", "state_size", of=("tracking.stonesoup",))
def test_states_are_laid_out_as_said(tmp_path):
    file = tmp_path / "fixed.py"
    file.write_text(FAKE.format(size=9, length=9, mapping="(8, 1, 3)"))
    keys = {"position_mapping": [8, 1, 3], "velocity_mapping": [0, 4, 2], "state_size": 9}
    told = rows(run(scene(f"{file}:build", 1, {"radar": RADAR}, **keys)), "state_tracks")
    names = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
    # East, north and up are components 8, 1 and 3; their rates 0, 4 and 2.
    assert [told[-1][name] for name in names] == [1.0, 8.0, -3.0, 4.0, 0.0, -2.0]
    assert told[-1]["covariance_00_m2"] == 2.0 and told[-1]["covariance_11_m2"] == 9.0
    assert told[-1]["covariance_44_m2_s2"] == 1.0 and told[-1]["covariance_55_m2_s2"] == 3.0
    assert {row["track_status"] for row in told} == {"coasted"}  # it says of no measurement
    with pytest.raises(WRONG, match="must name six components of a state"):
        run(scene(f"{file}:build", 1, position_mapping=[0, 1, 9]))
    file = tmp_path / "short.py"
    file.write_text(FAKE.format(size=6, length=5, mapping="(0, 2, 4)"))
    with pytest.raises(WRONG, match=r"5 components, and position_mapping"):
        run(scene(f"{file}:build", 1, {"radar": RADAR}))


def given(simulation):
    """Return when looks were made that a tracker was given, s, and what of each."""
    told = simulation.components["tracker"]._tracker.given
    told.clear()  # of the class
    simulation.run()
    return [(when - datetime(2000, 1, 1)).total_seconds() for when, _ in told], told


def test_looks_wait_for_older_ones_that_a_scene_foresees(tmp_path):
    """One sensor 0.3 s late, the other in time with something to see or in vain."""
    file = tmp_path / "fixed.py"
    file.write_text(FAKE.format(size=6, length=6, mapping="(0, 2, 4)"))
    for late, reach_km in (("radar", 20.0), ("camera", 20.0), ("camera", 1.0)):
        # Told when something comes 0.3 s after a look: of the camera's at 0.6 s, its own report.
        expected = [0.0, 0.0, 0.2, 0.25, 0.4, 0.5] + ([0.6] if late == "camera" else [])
        sensors = {"radar": {**RADAR, "range_km": reach_km}, "camera": dict(CAMERA)}
        sensors[late]["latency_s"] = 0.3
        simulation = Simulation(dsa_des.load_scene(scene(f"{file}:build", 1, sensors)))
        times, _ = given(simulation)
        assert times == expected
        assert simulation.components["tracker"].report() == {"late_looks": {"tracker": {}}}
    sensors = {"radar": RADAR, "camera": {**CAMERA, "processor": "chip"}}
    queued = {**scene(f"{file}:build", 1, sensors), "processors": {"chip": {"service_s": 0.3}}}
    simulation = Simulation(dsa_des.load_scene(queued))
    times, _ = given(simulation)
    assert times == [0.0, 0.25, 0.5, 0.75]
    late = {"camera": {"looks": 3, "left_out": 3, "share": 1.0}}
    assert simulation.components["tracker"].report() == {"late_looks": {"tracker": late}}


def test_a_silent_tracker_is_given_looks_in_vain_until_its_tracks_end(tmp_path):
    """The last detection is of 4 s; at 4 Hz nothing is expected for 6 s, at 1/4 Hz for 12."""
    file = tmp_path / "own.py"
    text = FAKE.format(size=6, length=6, mapping="(0, 2, 4)")
    file.write_text(text.replace(
        "return time, {self.track}",
        "seen = max(when for when, some in self.given if some)\n"
        "        return time, {self.track} if (time - seen).total_seconds() < 12.3 else set()",
    ))  # fmt: skip
    leaves = {**crooked.ROLLING, "end_time_s": 4.1}
    for rate_hz, first_s, late_s in ((4, 10.0, 0), ("1/4", 16.0, 0), (4, 10.0, "0.3")):
        table = chain(
            {"radar": {**RADAR, "scan_rate_hz": rate_hz, "latency_s": late_s}}, targets=[leaves],
            fusion={"type": "fusion.gated"}, duration_s=18,
            tracker={"type": "tracking.stonesoup", "builder": f"{file}:build"},
        )  # fmt: skip
        times, told = given(Simulation(dsa_des.load_scene(table)))
        in_vain = [time for time, (_, found) in zip(times, told, strict=True) if not found]
        assert first_s <= min(in_vain) <= first_s + 0.5 and max(in_vain) <= 16.3 + 0.5
        told.clear()  # of the class
        *_, last = rows(run(table), "state_tracks")
        assert last["track_status"] == "deleted"
        assert 16.3 <= last["time_s"] <= 16.3 + 0.5 + float(late_s)


def test_it_is_given_every_look_and_no_name(tmp_path):
    file = tmp_path / "fixed.py"
    file.write_text(FAKE.format(size=6, length=6, mapping="(0, 2, 4)"))
    short = {**RADAR, "range_km": 2.3}
    sensors = {"radar": short, "camera": {**CAMERA, "latency_s": 0.1}}
    simulation = Simulation(dsa_des.load_scene(scene(f"{file}:build", 1, sensors)))
    times, told = given(simulation)
    # The radar's look at 0.25 s waits for the camera's of 0.2 s, which comes at 0.3 s.
    assert times == [0.0, 0.0, 0.2, 0.25, 0.4, 0.5, 0.6, 0.75, 0.8]
    # One target is beyond the radar's range, both are within the camera's.
    said = [sorted(str(one.metadata) for one in found) for _, found in told]
    radar, camera = ["{'sensor': 'radar'}"], ["{'sensor': 'camera'}"] * 2
    assert said == [radar, camera, camera, radar, camera, radar, camera, radar, camera]


def test_order_draws_and_bytes_are_repeatable(tmp_path):
    """Sets are walked through in the order of their making, and draws are the block's own."""
    import random

    from stonesoup.types.track import Track

    from components.stone_soup.library import Repeatable

    walks = []
    for _ in range(2):
        ours = Repeatable(7)
        np.random.seed(len(walks))  # noqa: NPY002
        before = np.random.get_state()[1].tolist(), random.getstate()  # noqa: NPY002
        junk = [object() for _ in range(len(walks) * 997)]
        with ours.isolated_random_state():
            tracks = [Track() for _ in range(40)]
            walked = [tracks.index(t) for t in set(tracks)]
            walks.append((walked, np.random.normal(), random.random()))  # noqa: NPY002
        assert (np.random.get_state()[1].tolist(), random.getstate()) == before  # noqa: NPY002
        del junk
    assert walks[0] == walks[1] and walks[0][0] == list(range(40))
    builder = documented(tmp_path)
    tables = [run(scene(builder, 2))["state_tracks"] for _ in range(2)]
    assert tables[0].equals(tables[1])
    study = dsa_des.study(scene(builder, 2), metrics=["tracking"], replicas=2, workers=1)
    assert len(study.summary)


def test_what_is_wrong_is_said(tmp_path, monkeypatch):
    file = tmp_path / "mine.py"
    file.write_text(
        "def nothing(): return 3\ndef fails(): raise KeyError('x')\nvalue = 1\n"
        "class T:\n    def update_tracker(self, time, found): raise RuntimeError('no')\n"
    )
    for name, message in {
        "nothing": "returned int, which has no update_tracker",
        "fails": "failed with KeyError: 'x'",
        "value": "is no function that builds a tracker",
        "valu": "has no 'valu'; did you mean 'value'",
        "T": "RuntimeError: no",
    }.items():
        with pytest.raises(WRONG, match=re.escape(message)):
            run(scene(f"{file}:{name}", 1))
    monkeypatch.setitem(sys.modules, "stonesoup", None)  # as if it were not installed
    with pytest.raises(WRONG, match=r"tracking.stonesoup needs Stone Soup: pip install"):
        run(scene(f"{file}:nothing", 1))


def test_the_extra_is_imported_only_where_it_is_used():
    program = "import sys, components.stone_soup.tracker, components.export as e; e.stone_soup; "
    program += "assert not [m for m in sys.modules if m.startswith('stonesoup')]"
    subprocess.run([sys.executable, "-P", "-c", program], check=True, cwd=PAGE.parents[1])


def test_windows_and_company_change_no_byte_and_names_are_not_seen(tmp_path, monkeypatch):
    loaded = dsa_des.load_scene(scene(documented(tmp_path), 2))
    alone = same_in_any_window(loaded, (3,))["state_tracks"]
    same_as_alone(replicas_of(loaded, {}, {}))
    original = StoneSoupTracker.run

    def blind(self, wake):
        fused, of = wake._held["fused"]
        other = copy(fused.take(slice(0, len(fused))))
        other.target, other.roster = -7 - other.target, None
        for name in ("true_azimuth_rad", "true_elevation_rad", "true_range_m"):
            setattr(other, name, None)
        wake._held = {"fused": (other, of)}
        return original(self, wake)

    monkeypatch.setattr(StoneSoupTracker, "run", blind)
    assert tables_of(loaded)[1]["state_tracks"].equals(alone)
