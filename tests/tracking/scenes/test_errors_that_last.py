"""Errors that are the same again at the next look, and what a filter makes of them."""

from types import SimpleNamespace

import numpy as np
import pytest

import dsa_des
from components.estimation.kalman import equivalent_independent_variance
from components.messages.detections import LastingError, LastingPart, SensorOffer
from components.optical.sensors import OpticalRangeBoundary
from components.tracking.gating import covariance_with_last_errors
from components.tracking.rules import LastingErrors
from docs.make.track_consistency import CASES, nees_of, scene_of_case
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation

FIRST_COMMAND = ["blocks.fusion.type='fusion.pass_through'", "blocks.tracker.type='tracking.ekf'"]


def test_tracks_of_the_first_command_are_as_sure_as_they_are_right():
    """23 where the grids' errors are taken for new ones; 6 is honest, and 3 without manoeuvres."""
    scene = dsa_des.load_scene("first_light", sets=FIRST_COMMAND)
    result = dsa_des.study(scene, metrics=["tracking"], replicas=1, workers=1)
    nees = {row["result"]: row["value"] for row in result.summary.to_pylist()}
    assert 4.0 < nees["track_nees_mean"] < 8.0


@pytest.mark.parametrize(
    "sets",
    [
        [f"blocks.{name}.errors='signal'" for name in ("radar", "eo", "ir")],
        ["navigation.attitude_noise_deg=[0.1,0.1,0.1]", "navigation.position_noise_m=[3,3,5]"],
        ["navigation.position_noise_m=[3,3,5]", "navigation.position_correlation_time_s=0"],
        ["navigation.position_noise_m=[10,10,15]", "navigation.position_correlation_time_s=2"],
    ],
    ids=["glint", "navigation", "white place", "place of two seconds"],
)
def test_neither_glint_nor_navigation_is_averaged_away(sets):
    """Taken for new at every look: 8.2 and 46. One track for each target, whatever errs.

    A camera knows no range, so how much of a direction is the ownship's place is the tracker's to
    say: unsaid, two targets were eleven tracks.
    """
    scene = dsa_des.load_scene("first_light", sets=[*FIRST_COMMAND, *sets])
    result = dsa_des.study(scene, metrics=["tracking"], replicas=1, workers=1)
    found = {row["result"]: row["value"] for row in result.summary.to_pylist()}
    assert 2.0 < found["track_nees_mean"] < 7.0
    assert found["track_ambiguity"] < 1.05 and found["track_spuriousness"] == 0.0


@pytest.mark.parametrize("case", ["bias", "lasting"])
def test_biases_and_lasting_errors_are_not_averaged_away(case):
    """Taken for new ones at every look, 94 % of all tracks have a NEES above 60."""
    nees = nees_of(CASES[case], 8)
    assert np.isfinite(nees).all() and (nees > 60.0).mean() < 0.1 and np.nanmedian(nees) < 30.0


def test_what_is_new_is_what_the_best_of_both_says():
    """By the variance of the best unbiased estimate, 1 / (1ᵀ C⁻¹ 1), of any two with C."""
    rng = np.random.default_rng(5)
    variance, spread = rng.uniform(0.2, 4.0, (2, 1, 200))
    common = rng.uniform(0.0, 0.95, (1, 200)) * np.minimum(variance, spread)
    new = equivalent_independent_variance(variance, common, spread)[0]
    for r, p, k, found in zip(variance[0], spread[0], common[0], new, strict=True):
        best = 1.0 / np.linalg.inv([[p, k], [k, r]]).sum()
        assert p * found / (p + found) == pytest.approx(best, rel=1e-9)
    told = equivalent_independent_variance(
        np.array([[2.0, 2.0]]), np.array([[2.0, 0.0]]), np.ones((1, 2))
    )
    assert told[0, 0] > 1e5 and told[0, 1] == 2.0  # surer than the cell it tells nothing


@pytest.mark.parametrize("noise", [0.0, 0.15, 0.3])
@pytest.mark.parametrize("moved", [0.0, 0.1, 0.4])
def test_rounding_has_in_common_at_least_what_two_looks_have(noise, moved):
    """By a million roundings of values anywhere in a cell, moved by so much either way."""
    rng = np.random.default_rng(2)
    true = rng.uniform(0.0, 40.0, 1_000_000)
    later = true + moved * rng.choice([-1.0, 1.0], len(true))
    errors = [np.rint(x + noise * rng.normal(size=len(x))) - x for x in (true, later)]
    lasting = LastingErrors.of(
        {"eye": SensorOffer(False, 1.0, lasting={"azimuth": LastingError(step=1.0)})}, ("eye",)
    )
    one = np.zeros((1, 1))
    variance = one + 1.0 / 12.0 + noise**2
    found = lasting.covariance_with_last_errors(
        [0], one.astype(int), variance, one + moved, one + 0.1, one
    )[0, 0]
    real = float(np.mean(errors[0] * errors[1]))
    assert found >= real - 3e-4
    if moved == 0.0:
        assert found <= 1.65 * real + 1e-3  # pi² / 6 by the bound's making
    assert (
        lasting.covariance_with_last_errors([0], one.astype(int), variance, one, one + np.inf, one)[
            0, 0
        ]
        == 0.0
    )


@pytest.mark.parametrize(
    "error",
    [
        LastingError(step=1.0),
        *(LastingError(parts=(LastingPart(**{name: 0.1}),))
          for name in ("variance", "across_m2", "share")),
    ],
)  # fmt: skip
def test_what_errors_have_in_common_is_asked_of_sensors_whose_errors_last(error):
    """Nothing is kept of the others, whose errors are all new; -1 is no sensor."""
    offers = {"eye": SensorOffer(False, 1.0, lasting={}),
              "radar": SensorOffer(False, 1.0, lasting={"elevation": error})}  # fmt: skip
    lasting = LastingErrors.of(offers, ("eye", "radar"))
    assert (
        lasting.is_correlated[[0, 1, -1]].tolist() == [False, True, False]
        and lasting.correlated_sensors_mask == 0b10
    )


class Silent(OpticalRangeBoundary):
    """A camera that says nothing of what lasts."""

    def offer(self, port):
        return SensorOffer(False, 0.01)


def test_a_filter_that_is_told_nothing_of_it_warns():
    case = CASES["velocity"]
    traffic = {"type": "traffic.scripted", "ownship": {
        "lat_deg": 0, "lon_deg": 0, "alt_m": 100, "heading_deg": 0, "speed_mps": 10},
        "intruders": case.targets}  # fmt: skip
    scene = scene_of_case(case, traffic)

    def said():
        found = notes_of_scene(Simulation(dsa_des.load_scene(scene)))
        return [text for text in found if "lasts from look to look" in text]

    assert said() == []
    scene["blocks"]["slow"]["type"] = f"{__name__}:Silent"
    (text,) = said()
    assert "blocks.tracker: slow does not say" in text


def test_looks_have_in_common_what_lies_between_them_whichever_was_first():
    """2 s apart, 0.02 rad across the line on which azimuths jump, in either order: 3 s is other."""
    told = []
    lasting = SimpleNamespace(
        is_correlated=np.array([True]),
        covariance_with_last_errors=lambda *given: told.append(given),
    )
    rules = SimpleNamespace(lasting=lasting, ticks_per_s=10)
    part = SimpleNamespace(
        tick=np.array([40, 60, 30]), seen_tick=np.array([[60, 40, 60]]),
        seen=np.array([np.pi - 0.01, 0.2, 900.0])[:, np.newaxis, np.newaxis] * np.ones((3, 1, 3)),
    )  # fmt: skip
    scans = SimpleNamespace(source=np.zeros((3, 3), dtype=int))
    foreseen = np.array([0.01 - np.pi, 0.5, 950.0])[:, np.newaxis] * np.ones((3, 3))
    covariance_with_last_errors(
        rules, part, np.arange(3), scans, [0, 1, 2], np.arange(3), foreseen, np.ones((3, 3))
    )
    ((_, _, _, moved, since_s, _),) = told
    assert np.allclose(moved, np.array([[0.02], [0.3], [50.0]]))
    assert (since_s == [2.0, 2.0, 3.0]).all()
