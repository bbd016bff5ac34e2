"""The blocks and the metric that docs/extending.md shows do what the page says of them."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from snippets import ROOT, file_of, read_snippets

from dsa_des.block.message import Text
from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.replicas.changed_scene import Replica
from dsa_des.replicas.replicas import Recorded
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.studies.metric import Group, find_metric, needed_columns

MODULE = "blocks_of_the_page"


@pytest.fixture(autouse=True)
def shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the page's module on the path."""
    files: dict[str, list[str]] = {}
    for part in read_snippets("docs/extending.md"):
        if known := file_of(part):
            files.setdefault(known[0].replace("mymodule", MODULE), []).append(part.text)
    for name, parts in files.items():
        (tmp_path / name).write_text("\n".join(parts), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))


def recorded(scene: Path, **load: Any) -> dict[str, dict[str, Any]]:
    """Run a scene and return its tables: lists of text, arrays of numbers."""
    memory = MemorySink()
    Simulation(load_scene(scene, **load), recorder=Recorder([memory])).run()
    return {
        name: {
            column: values.to_pylist() if values.type == "string" else values.to_numpy()
            for column, values in zip(table.column_names, map(_plain, table.columns), strict=True)
        }
        for name, table in memory.tables().items()
    }


def _plain(column: Any) -> Any:
    return column.cast("string") if "string" in str(column.type) else column


SHORT = ["duration_s=30", "blocks.traffic.intruders[0].north_m=3000"]


def test_the_ladder_is_climbed_and_a_block_without_one_says_so(
    configs: Path, tmp_path: Path
) -> None:
    scene, out = str(configs / "first_light.toml"), str(tmp_path / "cost")
    of_radar = ["cost", scene, "--block", "radar", "--duration", "2", "--repeats", "1"]
    changed = ["--swap", f"radar={MODULE}:MyFadingRadar", "--set", "blocks.radar.reach_km=12"]
    done = CliRunner().invoke(main, [*of_radar, *changed, "--out", out, "--json"])
    assert done.exit_code == 0, done.output
    step, smooth = json.loads(done.stdout)
    assert (step["rung"], smooth["rung"]) == ("step", "smooth")
    # Both intruders are near the reach for two seconds, where a half is what the step is wrong by.
    assert step["error_max"] == pytest.approx(0.5, abs=0.02) and smooth["error_max"] is None
    done = CliRunner().invoke(main, [*of_radar, "--swap", f"radar={MODULE}:MyRadar"])
    assert done.exit_code == 2 and f"radar: {MODULE}:MyRadar declares no ladder" in done.stderr


def test_the_fusion_reports_what_two_sensors_see_at_once(configs: Path) -> None:
    scene = configs / "first_light.toml"
    found = recorded(scene, sets=SHORT, swaps=[f"fusion={MODULE}:MyFusion"])
    seen: dict[tuple[int, str], list[str]] = {}
    detections = found["detections"]
    for tick, target, sensor in zip(
        detections["tick"].tolist(), detections["target"], detections["block"], strict=True
    ):
        seen.setdefault((tick, target), []).append(sensor)
    several = {key: sorted(sensors) for key, sensors in seen.items() if len(sensors) > 1}
    fused = found["fused"]
    keys = zip(fused["tick"].tolist(), fused["target"], strict=True)
    reported = {
        key: sorted(text.split("+")) for key, text in zip(keys, fused["sensors"], strict=True)
    }
    assert 0 < len(several) < len(seen)
    assert reported == several


def test_the_tracker_smooths_and_with_gain_1_holds_what_was_measured(configs: Path) -> None:
    scene = configs / "first_light.toml"
    swap = [f"tracker={MODULE}:MyTracker"]
    stub = recorded(scene, sets=SHORT)["tracks"]
    exact = recorded(scene, sets=[*SHORT, "blocks.tracker.gain=1"], swaps=swap)["tracks"]
    for column in ("tick", "range_m", "azimuth_rad", "elevation_rad", "age_s"):
        np.testing.assert_allclose(exact[column], stub[column], rtol=0, atol=1e-12)
    assert exact["updated_by"] == stub["updated_by"]
    smooth = recorded(scene, sets=[*SHORT, "blocks.tracker.gain=0.1"], swaps=swap)["tracks"]
    assert smooth["tick"].tolist() == stub["tick"].tolist()
    own = [i for i, name in enumerate(stub["target"]) if name == "head_on"]
    steps = np.abs(np.diff(stub["elevation_rad"][own])).sum()
    assert np.abs(np.diff(smooth["elevation_rad"][own])).sum() < steps


def tracked(configs: Path, tracker: str, *sets: str) -> dict[str, Any]:
    scene = configs / "first_light.toml"
    swaps = [f"tracker={tracker}", "fusion=fusion.pass_through"]
    return recorded(scene, sets=[*SHORT[1:], "duration_s=8", *sets], swaps=swaps)["state_tracks"]


def test_the_filter_that_fades_is_less_sure_and_without_fading_the_extended_kalman(
    configs: Path,
) -> None:
    plain = tracked(configs, "tracking.ekf")
    same = tracked(configs, f"{MODULE}:MyFilter", "blocks.tracker.fading_per_s=0")
    fading = tracked(configs, f"{MODULE}:MyFilter")
    assert len(plain["tick"]) > 50
    for column in ("tick", "north_m", "covariance_00_m2"):
        np.testing.assert_array_equal(same[column], plain[column])
    sure, unsure = (np.nanmedian(one["covariance_33_m2_s2"]) for one in (plain, fading))
    assert unsure > 1.05 * sure


def test_the_association_takes_only_what_is_beyond_doubt(configs: Path) -> None:
    clutter = ["blocks.eo.false_alarms_per_frame=100"]
    plain = tracked(configs, "tracking.ekf", *clutter)
    cautious = tracked(configs, f"{MODULE}:MyAssociation", *clutter)
    hits = {}
    for name, found in (("plain", plain), ("cautious", cautious)):
        held = np.isin(found["track_status"], ("confirmed", "coasted"))
        hits[name] = np.mean((found["updated_s"] == found["state_s"])[held])
    assert 0 < hits["cautious"] < hits["plain"]
    alone = tracked(configs, f"{MODULE}:MyAssociation", "blocks.traffic.intruders[1].north_m=90000")
    known = tracked(configs, "tracking.ekf", "blocks.traffic.intruders[1].north_m=90000")
    assert len(known["tick"]) > 50
    np.testing.assert_array_equal(alone["north_m"], known["north_m"])


def test_the_column_says_how_much_farther_than_the_nearest(configs: Path) -> None:
    swap = [f"tracker={MODULE}:MyRankingTracker"]
    tracks = recorded(configs / "first_light.toml", sets=SHORT, swaps=swap)["tracks"]
    for tick in np.unique(tracks["tick"]):
        now = tracks["tick"] == tick
        if np.isfinite(tracks["range_m"][now]).any():
            nearest_m = np.nanmin(tracks["range_m"][now])
            behind_m = tracks["range_m"][now] - nearest_m
            np.testing.assert_array_equal(tracks["behind_m"][now], behind_m)
    assert np.nanmax(tracks["behind_m"]) > 100.0


def test_the_radome_takes_its_loss_twice_and_nothing_where_it_has_none(configs: Path) -> None:
    found = {}
    for loss_db in (None, 0.0, 0.8):
        radar = "radar.swerling" if loss_db is None else f"{MODULE}:MyRadomeRadar"
        sets = [*SHORT, "record.looks=true"]
        sets += [f"blocks.radar.radome_loss_db={loss_db}"] if loss_db else []
        tables = recorded(configs / "first_light.toml", sets=sets, swaps=[f"radar={radar}"])
        seen = tables["looks"]
        snr_db = zip(seen["tick"].tolist(), seen["target"], seen["snr_db"].tolist(), strict=True)
        found[loss_db] = {(tick, name): value for tick, name, value in snr_db if value == value}
    assert found[0.0] == found[None]
    assert len(found[None]) > 50
    for key in found[None]:
        assert found[None][key] - found[0.8][key] == pytest.approx(1.6, abs=1e-9)


def test_the_reader_flies_its_file_and_says_all_that_is_wrong_with_one(
    configs: Path, tmp_path: Path
) -> None:
    scene, swaps = configs / "replay_daa.toml", [f"traffic={MODULE}:MyTraffic"]
    file = tmp_path / "flights.jsonl"
    sets = [f"blocks.traffic.file={file}"]
    traffic: Any = Simulation(load_scene(scene, swaps=swaps, sets=sets)).components["traffic"]
    own, (other,) = traffic.own, traffic.targets
    assert (own.name, other.name) == ("own", "other")
    assert other.at(np.array([0.0, 60.0])).lat_deg.tolist() == [52.06, 52.03]
    detections = recorded(scene, sets=sets, swaps=swaps)["detections"]
    assert set(detections["target"]) == {"other"}
    file.write_text('["own", 0, 52, 4, 1]\n["own", 1]\n{}\n', encoding="utf-8")
    with pytest.raises(SceneError, match=r"line 2: must be .*(\n.*)*line 3: must be"):
        Simulation(load_scene(scene, swaps=swaps, sets=sets))


def test_the_policy_lets_two_wait_and_loses_the_next(configs: Path, tmp_path: Path) -> None:
    scene = tmp_path / "busy.toml"
    text = scene.read_text(encoding="utf-8").replace("configs/first", f"{configs}/first")
    scene.write_text(text.replace("mymodule", MODULE), encoding="utf-8")
    rows = recorded(scene, sets=["duration_s=8", SHORT[1]])["processing"]
    outcomes = np.array(rows["outcome"])
    assert set(outcomes) == {"done", "dropped"}
    assert rows["queue_length"].max() == 2
    # Two cameras' frames and more come while one is worked on: whoever is lost never waited.
    lost = outcomes == "dropped"
    assert (rows["entered_s"][lost] == rows["tick"][lost] / 1e9).all()
    assert (np.diff(rows["entered_s"][~lost]) >= 0).all()


@pytest.mark.parametrize(
    ("policy", "says"),
    [("wiat", "did you mean 'wait'"), (f"{MODULE}:Looks", "is not a .*QueuePolicy"),
     (f"{MODULE}:TwoWiat", "did you mean 'TwoWait'")],
)  # fmt: skip
def test_no_policy_is_one_error_of_the_key(configs: Path, policy: str, says: str) -> None:
    table = f'{{gpu={{service_s=0.07, when_busy="{policy}"}}}}'
    with pytest.raises(SceneError, match=rf"processors.gpu.when_busy.*{says}"):
        load_scene(configs / "first_light.toml", sets=[f"processors={table}"])


def test_the_avoidance_turns_once_when_a_track_is_near(configs: Path) -> None:
    found = recorded(
        configs / "benchmark/manoeuvres.toml",
        sets=["duration_s=30"],
        swaps=[f"avoidance={MODULE}:MyAvoidance"],
    )
    tracks, turns = found["tracks"], found["manoeuvres"]
    near = tracks["tick"][tracks["range_m"] < 5000.0]
    assert turns["tick"].tolist() == [near.min()]
    assert np.degrees(turns["turn_rad"]).tolist() == pytest.approx([90.0])


def test_the_metric_counts_scans_of_every_replica(configs: Path) -> None:
    scene = load_scene(configs / "first_light.toml")
    metric = find_metric(f"{MODULE}:Looks")(None, scene)
    runs = [
        Recorded({"scans": {"tick": np.arange(n), "block": radar_rows(n)}}, 10**9, 6.0, dict)
        for n in (3, 0, 5)
    ]
    group = Group(scene, [Replica(k) for k in range(3)], runs, needed_columns([metric]))
    found = metric.measure(group)
    assert [result.name for result in metric.results()] == list(found) == ["looks"]
    assert found["looks"].tolist() == [3.0, 0.0, 5.0]


def radar_rows(count: int) -> Text:
    return Text(np.zeros(count, dtype=np.int64), ("radar",))


#: Files that a newcomer may have to open, the page counted.
MOST_FILES = {
    "a sensor": 6, "a fusion": 4, "a filter": 4, "an association": 4, "a metric": 2,
    "an association with its own `update`": 4, "a column of a message": 2,
    "an effect of a radar": 3, "a reader of traffic": 3, "a policy of a shared processor": 3,
}  # fmt: skip


def test_the_files_that_a_newcomer_opens_are_there_and_as_few_as_the_page_says():
    page = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (an? [^|]+) \| (\d+) \| (.+) \|$", page, re.MULTILINE)
    opened = {what: re.findall(r"`([\w/]+\.py)`", files) for what, _, files in rows}
    assert opened.keys() >= MOST_FILES.keys()
    for what, count, _ in rows:
        assert all((ROOT / file).is_file() for file in opened[what]), what
        assert int(count) == 1 + len(opened[what]) <= MOST_FILES.get(what, 6), what


@pytest.mark.parametrize(
    ("block", "table", "message", "base"),
    [
        ("tracker", "tracks", "components.messages:Tracks", "components.tracking.stub:TrackerStub"),
        (
            "fusion", "fused", "components.messages:FusedDetections",
            "components.fusion.pick_best:PickBest",
        ),
    ],
)  # fmt: skip
def test_a_subclass_of_ours_records_a_column_of_its_own(
    configs: Path, tmp_path: Path, block: str, table: str, message: str, base: str
) -> None:
    imports = (f"from {where.replace(':', ' import ')} as {name}"
               for where, name in ((message, "Sent"), (base, "Ours")))  # fmt: skip
    (tmp_path / f"own_{table}.py").write_text(
        "\n".join(imports) + "\n"
        "from dataclasses import dataclass\n"
        "import numpy as np\n"
        "from dsa_des.block.component import Output\n"
        "from dsa_des.block.message import column\n"
        "@dataclass(eq=False)\n"
        "class Own(Sent):\n"
        "    half_m: np.ndarray = column('m', '', 'half the range', default=None, kw_only=True)\n"
        "class Block(Ours):\n"
        f"    outputs = {{'{table}': Output(Own, 'With half the range.')}}\n"
        "    def run(self, wake):\n"
        "        sent = super().run(wake)\n"
        "        return None if sent is None else Own(**vars(sent), half_m=0.5 * sent.range_m)\n",
        encoding="utf-8",
    )
    swap = [f"{block}=own_{table}:Block"]
    rows = recorded(configs / "first_light.toml", sets=["duration_s=5"], swaps=swap)[table]
    assert np.isfinite(rows["range_m"]).any()
    np.testing.assert_array_equal(rows["half_m"], 0.5 * rows["range_m"])
