"""Echoes that fade slowly: a process of the target and the instant, with each model's own Pd."""

import math
from typing import Any

import crooked
import numpy as np
import pytest
from covering import covers
from scipy.special import gammaincc
from scipy.stats import gamma, kstest, ncx2, norm
from wired import HEARS_ALL, chain, decided, rows, run

from components.radar.detection import detection_probability
from components.radar.rcs import Scatterers, fading_power
from dsa_des.errors import SceneError
from dsa_des.library.scenes import load_scene
from dsa_des.record.recording import Recorder
from dsa_des.record.sinks import MemorySink
from dsa_des.running.simulation import Simulation
from dsa_des.time.randomness import Stream, target_keys

PFA = 1e-4
RADAR: dict[str, Any] = {
    **{key: value for key, value in HEARS_ALL.items() if key != "threshold_db"},
    "type": "radar.swerling", "swerling": 1, "false_alarm_probability": PFA, "scan_rate_hz": 10,
}  # fmt: skip
#: So strong that a deep fade is detected too, so that the power of every look is recorded.
LOUD = {"power_w": 1e12}


def formation(count: int) -> list[dict[str, Any]]:
    """Aircraft that fly beside the ownship at some 2.5 km and stay there."""
    along = {key: crooked.OWNSHIP[key] for key in ("heading_deg", "speed_mps", "climb_mps")}
    turn = [2.0 * math.pi * number / count for number in range(count)]
    return [
        {"name": f"t{n}", "east_m": 2500 * math.sin(a), "north_m": 2500 * math.cos(a),
         "up_m": 300.0, **along} for n, a in enumerate(turn)
    ]  # fmt: skip


def looks(
    count: int, duration_s: float, window: int | None = None, table: str = "looks", **keys: Any
) -> Any:
    """Return the looks that detect one of a formation, or their detections, as columns."""
    scene = chain({"sensor": {**RADAR, **keys}}, targets=formation(count), duration_s=duration_s)
    sink = MemorySink()
    simulation = Simulation(
        load_scene({**scene, "record": {"looks": True}}), recorder=Recorder([sink]), window=window
    )
    simulation.run()
    found = sink.tables()[table]
    return found.filter(found["detected"]) if table == "looks" else found


def power(**keys: Any) -> Any:
    """Return the power of every look over its mean, (scans, targets), where all detect."""
    count, duration_s = keys.pop("count", 100), keys.pop("duration_s", 8)
    found = looks(count, duration_s, **{**LOUD, **keys}).to_pydict()
    mean = looks(count, 0.01, **{**LOUD, **keys, "swerling": 0, "offset_s": 0}).to_pydict()
    at = dict(zip(mean["target"], mean["snr_db"], strict=True))
    scans = max(found["scan"]) + 1
    values = np.full((scans, count), np.nan)
    for scan, name, db in zip(found["scan"], found["target"], found["snr_db"], strict=True):
        values[scan, int(name[1:])] = 10.0 ** (0.1 * (db - at[name]))
    assert np.isnan(values).sum() < 1e-3 * values.size
    return values


@covers("fluctuation_correlation_s", of=("radar.swerling",))
@pytest.mark.parametrize(("model", "degrees"), [(1, 2), (2, 2), (3, 4), (4, 4)])
def test_power_is_chi_square_and_its_correlation_falls_as_stated(model, degrees):
    """exp(-2 dt / tau) with tau 1.5 s: seen at lags of 0.1 to 2 s."""
    values = power(swerling=model, fluctuation_correlation_s=1.5, count=400)
    assert np.nanmean(values) == pytest.approx(1.0, abs=0.06)
    variance = 2.0 / degrees
    assert np.nanvar(values) == pytest.approx(variance, rel=0.12)
    # Half of the looks are below the median of the distribution.
    middle = np.nanmedian(values)
    assert gammaincc(degrees / 2, degrees / 2 * middle) == pytest.approx(0.5, abs=0.03)
    for lag in (1, 3, 8, 20):
        product = np.nanmean((values[lag:] - 1.0) * (values[:-lag] - 1.0)) / variance
        assert product == pytest.approx(math.exp(-2.0 * lag * 0.1 / 1.5), abs=0.09)
    # One target's fades tell nothing of its neighbour's.
    other = np.nanmean((values[:, 1:] - 1.0) * (values[:, :-1] - 1.0)) / variance
    assert abs(other) < 0.05


@pytest.mark.parametrize(("model", "pulses"), [(1, 1), (3, 1), (2, 1), (1, 4), (2, 4)])
def test_over_many_looks_pd_is_the_model_s_own(model, pulses):
    """Of many looks, the fades of which have nearly passed from scan to scan: 99 %."""
    big = (model, pulses) == (1, 1)
    count, scans = (500, 200) if big else (200, 100)
    # 12 dB or so on average.
    keys = {"swerling": model, "pulses": pulses, "power_w": 3.5, "fluctuation_correlation_s": 0.05}
    found = looks(count, scans / 10 - 0.01, **keys)
    steady = looks(count, 0.01, **{**keys, "swerling": 0, **LOUD}).to_pydict()["snr_db"]
    snr = 10.0 ** (0.1 * (np.array(steady) + 10.0 * math.log10(3.5 / LOUD["power_w"])))
    expected = float(np.mean(detection_probability(
        snr, pulses=pulses, false_alarm_probability=PFA, model=f"swerling{model}"
    )))  # fmt: skip
    assert 0.3 < expected < 0.99
    share = len(found) / (count * scans)
    # exp(-4) of a look's fade is left at the next one.
    spread = math.sqrt(expected * (1 - expected) / (count * scans) * (1 + 2 * math.exp(-4)))
    assert share == pytest.approx(expected, abs=norm.isf(0.005) * spread)


def test_a_faster_radar_sees_the_same_fades_at_the_same_instants():
    slow = power(scan_rate_hz=2, fluctuation_correlation_s=3.0)
    fast = power(scan_rate_hz=10, fluctuation_correlation_s=3.0)
    assert fast[::5] == pytest.approx(slow, rel=1e-9, nan_ok=True)
    late = power(scan_rate_hz=2, fluctuation_correlation_s=3.0, offset_s=0.3)
    assert fast[3::5] == pytest.approx(late, rel=1e-9, nan_ok=True)


def test_a_beam_that_sweeps_meets_the_fade_of_its_own_instant():
    """The same target a tenth of a second later in the sweep: correlation at that lag, not 1."""
    swept = power(beam_sweep=True, scan_rate_hz=1, fluctuation_correlation_s=0.5, count=36,
                  duration_s=12)  # fmt: skip
    started = power(scan_rate_hz=1, fluctuation_correlation_s=0.5, count=36, duration_s=12)
    ratio = np.abs(np.log(swept[:-1] / started[:-1]))
    late = np.nanmean(ratio, axis=0)
    assert np.nanmin(late) < 0.3 < np.nanmax(late)


def test_an_echo_fades_between_two_publications_of_where_its_target_is():
    radar = {**RADAR, **LOUD, "fluctuation_correlation_s": 0.2}
    scene = chain({"sensor": radar}, targets=formation(3))
    scene["blocks"]["traffic"]["update_rate_hz"] = 1
    published = {(row["scan"], row["target"]): row["snr_db"] for row in decided(run(scene))}
    assert len(published) == len(set(published.values())) == 30


def ball(x: Any) -> Any:
    """Return the Fourier transform of an even ball of radius 1, over its volume."""
    return 3.0 * (np.sin(x) - x * np.cos(x)) / x**3


@covers("scintillation_extent_m", of=("radar.swerling",))
@pytest.mark.parametrize("turned", [{"yaw_deg": 0.03}, {"roll_deg": 0.08}, {"pitch_deg": 0.06}])
@pytest.mark.parametrize("extent_m", [4.0, 8.0])
def test_an_echo_scintillates_as_the_target_turns(turned, extent_m):
    """Correlation of the scatterers in a ball, over the turn of the line of sight by pymap3d."""
    count, seen, sides = 500, [], []
    attitude = {"yaw_deg": 31.0, "pitch_deg": 11.0, "roll_deg": 38.0}
    for more in ({}, turned):
        angles = {key: value + more.get(key, 0.0) for key, value in attitude.items()}
        targets = [{**target, **angles} for target in formation(count)]
        radar = {**RADAR, **LOUD, "scintillation_extent_m": extent_m, "scan_rate_hz": 1}
        found = decided(run(chain({"sensor": radar}, targets=targets, duration_s=0.5)))
        by_name = {row["target"]: 10.0 ** (0.1 * row["snr_db"]) for row in found}
        power = np.array([by_name.get(target["name"], np.nan) for target in targets])
        seen.append(power / np.nanmean(power))
        sides.append([crooked.aspect(target) for target in targets])
    one, other = (np.array(side) / np.linalg.norm(side, axis=1)[:, np.newaxis] for side in sides)
    apart = np.linalg.norm(one - other, axis=1)
    wavelength_m = 299_792_458.0 / 35e9
    expected = float(np.mean(ball(2.0 * math.pi * extent_m / wavelength_m * apart) ** 2))
    assert np.nanvar(seen[0]) == pytest.approx(1.0, abs=0.4)
    found = float(np.nanmean((seen[0] - 1.0) * (seen[1] - 1.0)))
    assert found == pytest.approx(expected, abs=0.2)
    assert np.corrcoef(np.nan_to_num(seen))[0, 1] == pytest.approx(expected, abs=0.13)


def test_an_echo_scintillates_as_the_target_is_seen_from_farther_below():
    """Targets 2.2 m higher: nothing turns, the line of sight rises by 0.05 deg."""
    extent_m, count, seen, sides = 4.0, 400, [], []
    for more_m in (0.0, 2.2):
        targets = [{**target, "up_m": target["up_m"] + more_m} for target in formation(count)]
        radar = {**RADAR, **LOUD, "scintillation_extent_m": extent_m, "scan_rate_hz": 1}
        found = decided(run(chain({"sensor": radar}, targets=targets, duration_s=0.5)))
        by_name = {row["target"]: 10.0 ** (0.1 * row["snr_db"]) for row in found}
        seen.append([by_name.get(target["name"], 0.0) for target in targets])
        sides.append([crooked.ned(target) for target in targets])
    one, other = (np.array(side) / np.linalg.norm(side, axis=1)[:, np.newaxis] for side in sides)
    apart = np.linalg.norm(one - other, axis=1)
    wavelength_m = 299_792_458.0 / 35e9
    expected = float(np.mean(ball(2.0 * math.pi * extent_m / wavelength_m * apart) ** 2))
    assert 0.1 < expected < 0.5
    assert np.corrcoef(seen)[0, 1] == pytest.approx(expected, abs=0.2)


def test_who_is_seen_from_one_side_does_not_scintillate():
    still = power(scintillation_extent_m=0.5, count=40, duration_s=2)
    assert np.nanvar(still[0]) > 0.3
    assert still == pytest.approx(np.broadcast_to(still[0], still.shape), abs=0.03, nan_ok=True)


@pytest.mark.parametrize("extent_m", [5.0, None], ids=["lasting", "new at each look"])
def test_echoes_of_targets_with_models_of_their_own_are_as_if_alone(extent_m):
    """Who flies beside whom, and fluctuates how, changes nobody's echo."""
    targets = [
        {**target, "swerling": model, "yaw_deg": 31.0 + 40.0 * number}
        for number, (target, model) in enumerate(zip(formation(4), (3, 1, 0, 3), strict=True))
    ]
    each = {key: value for key, value in RADAR.items() if key != "swerling"}
    radar = {**each, **LOUD, "scan_rate_hz": 1}
    if extent_m is not None:
        radar["scintillation_extent_m"] = extent_m

    def seen(some: list[dict[str, Any]]) -> dict[str, list[float]]:
        found = run(chain({"sensor": radar}, targets=some, duration_s=0.5))
        both = decided(found), rows(found, "detections")  # in the mean, and as it came out
        return {
            name: [row["snr_db"] for each in both for row in each if row["target"] == name]
            for name in (target["name"] for target in some)
        }

    together = seen(targets)
    assert [len(both) for both in together.values()] == [2] * 4
    for target in targets:
        assert seen([target]) == {target["name"]: together[target["name"]]}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_over_targets_the_echo_of_scatterers_is_gaussian(seed):
    """Power of one and of two echoes against Gamma(1) and Gamma(2), 20,000 targets: 99 %."""
    keys = target_keys(tuple(f"t{number}" for number in range(20_000)))
    aspect = np.random.default_rng(seed).normal(size=(3, len(keys)))
    aspect /= np.linalg.norm(aspect, axis=0)
    scatterers = Scatterers(Stream(seed, "radar", "scatterers"), 6.0, 0.0086)
    parts = [
        *scatterers.echo_amplitudes(keys, tuple(aspect), 0),
        *scatterers.echo_amplitudes(keys, tuple(aspect), 1),
    ]
    for count in (2, 4):
        found = fading_power(parts[:count])
        assert kstest(found, gamma(count / 2, scale=2 / count).cdf).pvalue > 0.01
    assert np.abs(np.corrcoef(parts) - np.eye(4)).max() < 4.0 / math.sqrt(len(keys))


def test_a_look_has_a_steady_target_s_pd_at_the_power_it_meets():
    for keys in ({"fluctuation_correlation_s": 1.0}, {"scintillation_extent_m": 5.0}):
        found = looks(60, 0.5, power_w=3.5, **keys).to_pydict()
        snr = 10.0 ** (0.1 * np.array(found["snr_db"]))
        assert np.std(snr) > 1.0
        # Rice: a steady echo among noise, over -ln Pfa.
        expected = ncx2.sf(-2.0 * math.log(PFA), 2, 2.0 * snr)
        assert found["detection_probability"] == pytest.approx(expected, rel=1e-6)


def test_time_and_aspect_together_forget_with_the_time_where_the_aspect_stays():
    values = power(
        fluctuation_correlation_s=0.5, scintillation_extent_m=6.0, count=60, duration_s=4
    )
    product = np.nanmean((values[2:] - 1.0) * (values[:-2] - 1.0))
    assert product == pytest.approx(math.exp(-2.0 * 0.2 / 0.5), abs=0.15)
    assert abs(np.nanmean((values[15:] - 1.0) * (values[:-15] - 1.0))) < 0.15


def declared_share(lasts_s: float | None, rate_hz: float) -> float:
    keys: dict[str, Any] = {
        "power_w": 2.0,
        "scan_rate_hz": rate_hz,
        "declare_m": 3,
        "declare_n": 4,
    }
    if lasts_s is not None:
        keys["fluctuation_correlation_s"] = lasts_s
    found = looks(600, 1.5, table="detections", **keys).to_pydict()
    declared = {
        name for name, is_so in zip(found["target"], found["declared"], strict=True) if is_so
    }
    return len(declared) / 600


def expected_share(lasts_s: float | None, rate_hz: float, snr: float) -> float:
    """Brute force: amplitudes by recursion from look to look, a threshold, three of four."""
    draw = np.random.default_rng(11)
    scans, trials = round(1.5 * rate_hz), 40_000
    keep = 0.0 if lasts_s is None else math.exp(-1.0 / (rate_hz * lasts_s))

    def normal() -> Any:
        return (draw.standard_normal(trials) + 1j * draw.standard_normal(trials)) / math.sqrt(2.0)

    echo, hits = normal(), []
    for _ in range(scans):
        hits.append(np.abs(math.sqrt(snr) * echo + normal()) ** 2 > -math.log(PFA))
        echo = keep * echo + math.sqrt(1.0 - keep**2) * normal()
    seen = np.array(hits)
    runs = np.array([seen[max(0, k - 3) : k + 1].sum(axis=0) >= 3 for k in range(scans)])
    return float(np.mean(runs.any(axis=0)))


@pytest.mark.parametrize("rate_hz", [4, 20])
def test_declarations_hang_together_as_brute_force_has_them(rate_hz):
    """Independent looks declare nearly everyone soon; where a fade lasts, who is in it stays."""
    first = looks(600, 0.01, **LOUD, swerling=0).to_pydict()["snr_db"]
    snr = 10.0 ** (0.1 * (np.mean(first) + 10.0 * math.log10(2.0 / LOUD["power_w"])))
    shares = {}
    for lasts_s in (None, 1.0):
        expected = expected_share(lasts_s, rate_hz, snr)
        spread = 3.0 * math.sqrt(expected * (1 - expected) / 600) + 0.01
        shares[lasts_s] = declared_share(lasts_s, rate_hz)
        assert shares[lasts_s] == pytest.approx(expected, abs=spread)
    if rate_hz == 20:
        assert shares[None] > shares[1.0] + 0.08


def test_it_is_said_and_where_nothing_fluctuates_it_is_left_out():
    def verdict(**keys: Any) -> Any:
        scene = load_scene(chain({"sensor": {**RADAR, **keys}}))
        (item,) = (i for i in Simulation(scene).plan if i.effect.name == "lasting fluctuation")
        return item.verdict

    given = verdict(fluctuation_correlation_s=0.2)
    assert given.simulated and "looks 0.1 s apart is correlated with 0.368" in given.because
    assert verdict(fluctuation_correlation_s=0.2, swerling=0).because == "swerling is 0"
    assert not verdict().simulated
    # 8.57 mm over 17.1 m.
    assert "aspects 0.029 deg apart" in verdict(scintillation_extent_m=8.566).because


@pytest.mark.parametrize("key", ["fluctuation_correlation_s", "scintillation_extent_m"])
@pytest.mark.parametrize("value", [0, -1.0, 1e8, "long"])
def test_a_time_or_an_extent_that_cannot_be_is_one_error(key, value):
    with pytest.raises(SceneError) as caught:
        load_scene(chain({"sensor": {**RADAR, key: value}}))
    assert len(caught.value.problems) == 1
    assert f"blocks.sensor.{key}" in str(caught.value)
