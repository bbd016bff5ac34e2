"""A metric of a study may read the tables that a scene records on request: truth and looks."""

from pathlib import Path

import numpy as np
import pytest
from wired import chain, sensor

import dsa_des
from dsa_des.errors import SceneError
from dsa_des.results.record import NUMBER, Result
from dsa_des.studies.metric import Metric

HERE = "test_truth_and_looks"


class Missed(Metric):
    """Looks of the sensor that found nothing, and how high the targets truly are on average."""

    tables = {"looks": ("block", "evaluated", "detected"), "truth": ("target", "alt_m")}

    def results(self):
        return [Result("missed", NUMBER, "looks in vain"), Result("alt_m", NUMBER, "mean, m")]

    def measure(self, group):
        looks, truth = group.tables["looks"], group.tables["truth"]
        vain = looks["evaluated"] & ~looks["detected"]
        targets = np.asarray(truth["target"].codes) >= 0
        missed = np.bincount(looks["replica"][vain], minlength=len(group))
        of_run = truth["replica"][targets]
        total = np.bincount(of_run, truth["alt_m"][targets], minlength=len(group))
        return {"missed": missed.astype(float),
                "alt_m": total / np.bincount(of_run, minlength=len(group))}  # fmt: skip


def scene(**record):
    radar = sensor("radar.swerling", power_w=2.0, false_alarm_probability=1e-4, scan_rate_hz=10)
    return chain({"radar": radar}, duration_s=4, record=record)


def test_a_study_reads_the_truth_and_the_looks_of_its_runs(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    found = dsa_des.study(scene(looks=True), metrics=[f"{HERE}:Missed"], replicas=3, workers=1)
    runs = found.runs.to_pylist()
    for row in runs:
        alone = dsa_des.run({**scene(looks=True), "seed": row["seed"]})
        looks = [look for look in alone["looks"].to_pylist() if look["evaluated"]]
        assert row["missed"] == sum(not look["detected"] for look in looks) > 0
        heights = [at["alt_m"] for at in alone["truth"].to_pylist() if at["target"] is not None]
        assert row["alt_m"] == pytest.approx(np.mean(heights))
    assert len({row["missed"] for row in runs}) > 1


def test_a_table_that_is_not_recorded_is_said_before_the_study_runs(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    with pytest.raises(SceneError, match=r"needs the table 'looks'.*\[record\] looks = true"):
        dsa_des.study(scene(), metrics=[f"{HERE}:Missed"], replicas=2, workers=1)
    with pytest.raises(SceneError, match=r"needs the table 'truth'.*\[record\] truth = true"):
        dsa_des.study(scene(looks=True, truth=False), metrics=[f"{HERE}:Missed"], replicas=2)
