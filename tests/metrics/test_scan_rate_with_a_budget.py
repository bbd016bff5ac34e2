"""The study of scan rates with a budget of time against what Pd alone gives."""

import itertools
import math

import numpy as np
import pytest

import dsa_des
from components.radar.detection import first_declaration_probability
from docs.make import scan_rate as page
from docs.make.declaration_ranges import certain_range_m, mean_range_m


@pytest.mark.parametrize(("m", "n"), [(1, 1), (1, 3), (2, 2), (3, 5), (2, 4)])
def test_a_declaration_s_chances_are_those_of_all_histories(m, n):
    """Brute force: every outcome of eight looks, with its probability."""
    pd = np.random.default_rng(7).uniform(0.05, 0.9, 8)
    expected = np.zeros(8)
    for history in itertools.product((0, 1), repeat=8):
        chance = math.prod(p if hit else 1 - p for p, hit in zip(pd, history, strict=True))
        for look in range(8):
            if history[look] and sum(history[max(0, look - n + 1) : look + 1]) >= m:
                expected[look] += chance
                break
    assert first_declaration_probability(pd, m, n) == pytest.approx(expected, abs=1e-14)
    both = first_declaration_probability(np.stack([pd, pd[::-1]]), m, n)
    assert both[0] == pytest.approx(expected, abs=1e-14)


def test_a_rule_or_a_probability_that_cannot_be_is_refused():
    for m, n in ((0, 1), (3, 2), (1, 13)):
        with pytest.raises(ValueError, match="m is"):
            first_declaration_probability([0.5], m, n)
    with pytest.raises(ValueError, match=r"pd\[1\] is 1.5|pd is 1.5|1\.5"):
        first_declaration_probability([0.5, 1.5])


def test_a_budget_of_time_has_a_best_scan_rate_and_a_free_scan_has_none():
    """Runs of the ready study lie within 99.9 % bounds of what is computed."""
    rates = {"1/10": 0.1, "1/2": 0.5, "5": 5.0}
    result = dsa_des.study(
        page.STUDY, workers=1, sets=[
            "replicas=40", "runs_per_chunk=40", "figures=[]",
            'metrics=[{metric="declaration",m=3,n=5,'
            'sensors=["radar"],target="head_on"}]',
            'axes={"blocks.radar.budget"=["free","dwell"],'
            '"blocks.radar.scan_rate_hz"=["1/10","1/2",5]}',
        ],
    )  # fmt: skip
    approach = page.approach_of(page.study_scene())
    # Independent of the page: SNR for Pd 0.9114 of 1.76 dBsm at 6.91 km, for -15 dBsm at 1 m, with
    # the Pfa of 0.05 that the sensor flew with: whatever a study sets later, the hardware stays.
    known = (math.log(0.05) / math.log(0.9114) - 1.0) * 10 ** (-1.676) * 6910.0**4
    assert approach.snr_at_1_m == pytest.approx(known, rel=1e-12)
    assert (approach.pulses, approach.closing_m_s) == (5, 110.0)
    found = page.simulated(result)
    assert {key[0] for key in found} == {"free", "dwell"} and len(found) == 6
    certain = {}
    for (budget, rate), ranges in found.items():
        expected = page.of_budget(approach, budget, rate)
        there = ranges[~np.isnan(ranges)]
        share = min(1.0, float(expected[1].sum()))
        assert len(there) / 40 == pytest.approx(
            share, abs=3.3 * math.sqrt(share * (1 - share) / 40) + 1e-9
        )
        spread = 3.3 * float(np.std(there, ddof=1)) / math.sqrt(len(there))
        assert np.mean(there) == pytest.approx(mean_range_m(*expected), abs=spread)
        certain[budget, rate] = certain_range_m(*expected, 0.95)
        # No declaration is where the encounter began.
        assert np.max(there) < 0.8 * approach.from_m
    slow, middle, fast = (certain["dwell", rate] for rate in rates.values())
    assert middle > max(slow, fast)
    assert certain["free", 5.0] > certain["free", 0.5]
    # A longer look gains less where pulses are summed in power: the best rate is higher.
    amplitude, farthest_m = page.best_rate(approach, mean_range_m)
    # Another program's optima for the same radar: 0.29 Hz and 3.18 km, 0.73 Hz and 2.27 km.
    assert (amplitude, farthest_m) == pytest.approx((0.29, 3180.0), rel=0.02)
    surest = page.best_rate(approach, lambda *of: certain_range_m(*of, 0.95))
    assert surest == pytest.approx((0.73, 2270.0), rel=0.03)
    power, _ = page.best_rate(approach, mean_range_m, "noncoherent")
    assert 0.1 < amplitude < 0.5 * power < 2.0
