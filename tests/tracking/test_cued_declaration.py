"""What cues gain in the range of declaration, against the closed forms of Pd and of m of n."""

import math

import pytest

import dsa_des

SCENE = "configs/tracking/cueing.toml"
M, N = 3, 5


def expected_range(pd, range_m):
    """Mean range at which a target is first declared, over the looks at which it is.

    A recursion over all histories of the last looks, which shares nothing with the project's.
    """
    histories, total, mean = {(): 1.0}, 0.0, 0.0
    for chance, distance in zip(pd, range_m, strict=True):
        after = {}
        for history, weight in histories.items():
            for hit, share in ((True, chance), (False, 1.0 - chance)):
                last = (*history, hit)[-N:]
                if sum(last) >= M:
                    total += weight * share
                    mean += weight * share * distance
                else:
                    after[last] = after.get(last, 0.0) + weight * share
        histories = after
    assert total > 0.999
    return mean / total


def looks(duration_s, **sets):
    """Every look of the radar; the camera takes two pictures a second to keep it short."""
    told = ["record.looks=true", "blocks.eo.scan_rate_hz=2", *(f"{k}={v}" for k, v in sets.items())]
    scene = dsa_des.load_scene(SCENE, sets=told, duration_s=duration_s)
    run = dsa_des.run(scene)
    found = [row for row in run["looks"].to_pylist() if row["block"] == "radar"]
    return run, found


def test_the_gain_of_declaration_range_is_the_analytic_one():
    gains = []
    for factor in (1, 4):
        run, found = looks("80", **{"blocks.radar.cued_dwell_factor": factor})
        range_m = [row["true_range_m"] for row in found]
        # Swerling I, one pulse: Pd = Pfa^(1/(1+SNR)), calibrated at 6.91 km for 1.76 dBsm.
        pfa = 1e-4
        snr_known = math.log(pfa) / math.log(0.9114) - 1.0
        first_s = min(row["time_s"] for row in run["cues"].to_pylist()) + 0.5
        analytic = []
        for row in found:
            snr = snr_known * (6910.0 / row["true_range_m"]) ** 4 * 10 ** ((-10.0 - 1.76) / 10)
            snr *= factor if row["time_s"] >= first_s else 1.0
            analytic.append(pfa ** (1.0 / (1.0 + snr)))
        simulated = [row["detection_probability"] for row in found]
        assert simulated == pytest.approx(analytic, rel=1e-6)
        gains.append((expected_range(simulated, range_m), expected_range(analytic, range_m)))
    simulated, analytic = (cued - usual for usual, cued in zip(*gains, strict=True))
    assert simulated == pytest.approx(analytic, rel=0.01)
    assert simulated > 1500.0


def test_a_cue_moves_no_scan_and_no_draw_of_an_uncued_look():
    cued, plain = (looks("10", **{"blocks.radar.cued_dwell_factor": f})[1] for f in (4, 1))
    assert [r["time_s"] for r in cued] == [r["time_s"] for r in plain]
    first = [r for r in cued if r["time_s"] < 0.5]
    assert first == [r for r in plain if r["time_s"] < 0.5]


def test_no_cue_no_cost():
    """Without the wire nothing of it is built, and `explain` says so."""
    from dsa_des.running.simulation import Simulation

    scene = dsa_des.load_scene(SCENE)
    assert "cues" in Simulation(scene).components["radar"].context.effects
    plain = Simulation(dsa_des.load_scene("configs/first_light.toml", duration_s="1"))
    for name in ("radar", "eo", "ir"):
        assert "cues" not in plain.components[name].context.effects
    said = [one for one in plain.plan if one.effect.name == "cues"]
    assert {one.verdict.because for one in said} == {"no wire brings cues"}


def test_windows_of_a_cue_loop_are_as_long_as_its_delay(monkeypatch):
    """Nothing that is sent can come back sooner: no window is run twice but at the first cue."""
    from dsa_des.running.simulation import Simulation
    from dsa_des.running.windows import Rewinder

    done = {"save_state": 0, "restore": 0}
    for name in done:
        original = getattr(Rewinder, name)

        def counted(self, name=name, original=original):
            done[name] += 1
            return original(self)

        monkeypatch.setattr(Rewinder, name, counted)
    Simulation(dsa_des.load_scene(SCENE, duration_s="20")).run()
    assert done["save_state"] <= 42
    assert done["restore"] <= 1
