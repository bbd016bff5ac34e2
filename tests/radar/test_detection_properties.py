"""What holds for every detection probability: bounds, order, bits, shapes, messages."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from components.radar.detection import (
    METHODS,
    detection_probability,
    detection_threshold,
    miss_probability,
)

MODELS = [f"swerling{i}" for i in range(5)]
RADARS = [(1, 1e-6), (2, 1e-12), (3, 0.1), (10, 1e-4), (100, 1e-9), (1000, 1e-6)]

radars = st.fixed_dictionaries(
    {
        "pulses": st.sampled_from([1, 2, 3, 7, 30, 1000]),
        "false_alarm_probability": st.floats(1e-12, 0.1),
        "model": st.sampled_from(MODELS),
    }
)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("pulses", "pfa"), RADARS)
def test_rises_with_snr_on_a_fine_grid(model, pulses, pfa):
    snr = np.append(0.0, 10.0 ** np.linspace(-6.0, 6.0, 6001))
    radar = {"pulses": pulses, "false_alarm_probability": pfa, "model": model}
    pd, miss = detection_probability(snr, **radar), miss_probability(snr, **radar)
    assert pd[0] == pfa
    assert miss[0] == 1.0 - pfa
    assert np.all(np.diff(pd) >= 0.0)
    assert np.all(np.diff(miss) <= 0.0)
    assert np.all((pd >= pfa) & (pd <= 1.0) & (miss >= 0.0) & (miss <= 1.0))
    np.testing.assert_allclose(pd + miss, 1.0, rtol=1e-13)


@given(radar=radars, low=st.floats(0.0, 1e6), ratio=st.floats(1.0, 1e3))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_more_signal_never_detects_less(radar, low, ratio):
    fewer, more = detection_probability(np.array([low, low * ratio]), **radar)
    assert more >= fewer * (1.0 - 1e-13)
    assert radar["false_alarm_probability"] <= fewer <= 1.0


@given(radar=radars, snr=st.floats(min_value=0.0, allow_infinity=False))
@settings(derandomize=True, deadline=None, max_examples=100)
def test_any_finite_snr_without_a_floating_point_complaint(radar, snr):
    with np.errstate(all="raise"):
        pd, miss = detection_probability(snr, **radar), miss_probability(snr, **radar)
    assert 0.0 <= pd <= 1.0
    assert 0.0 <= miss <= 1.0


@pytest.mark.parametrize(
    ("method", "model"),
    [
        *((method, model) for method in ("exact", "table") for model in MODELS),
        ("gram_charlier", "swerling0"),
    ],
)
@pytest.mark.parametrize("pulses", [1, 2, 20])
def test_same_bits_in_every_shape(method, model, pulses):
    radar = {"pulses": pulses, "false_alarm_probability": 1e-6, "model": model, "method": method}
    snr = 10.0 ** np.random.default_rng(5).uniform(-4.0, 5.0, 10_000)
    for function in (detection_probability, miss_probability):
        whole = function(snr, **radar)
        for size in (1, 7):
            for start in (0, 123, 9_990):
                part = function(snr[start : start + size].copy(), **radar)
                assert part.tobytes() == whole[start : start + size].tobytes()
        assert function(snr[::3], **radar).tobytes() == whole[::3].tobytes()
        grid = function(snr.reshape(100, 100).T, **radar)
        assert grid.T.reshape(-1).tobytes() == whole.tobytes()
        assert float(function(float(snr[77]), **radar)).hex() == float(whole[77]).hex()


def test_pulses_and_false_alarms_broadcast():
    snr = np.array([[0.5], [5.0]])
    pulses = np.array([1, 4, 4])
    pfa = np.array([1e-3, 1e-3, 1e-6])
    together = detection_probability(snr, pulses=pulses, false_alarm_probability=pfa)
    assert together.shape == (2, 3)
    for i, j in np.ndindex(2, 3):
        alone = detection_probability(
            snr[i, 0], pulses=int(pulses[j]), false_alarm_probability=float(pfa[j])
        )
        assert together[i, j] == alone
    assert detection_threshold(pulses, pfa).shape == (3,)
    assert detection_probability(np.zeros((0, 4)), false_alarm_probability=0.1).shape == (0, 4)


def test_ends_and_alias():
    radar = {"false_alarm_probability": 1e-3, "pulses": 6}
    assert detection_probability(np.inf, **radar) == 1.0
    assert miss_probability(np.inf, **radar) == 0.0
    same = detection_probability([0.5, 3.0], model="swerling5", **radar)
    assert np.array_equal(same, detection_probability([0.5, 3.0], model="swerling0", **radar))
    # One pulse cannot change from pulse to pulse.
    for slow, fast in (("swerling1", "swerling2"), ("swerling3", "swerling4")):
        one = {"false_alarm_probability": 1e-5, "pulses": 1}
        assert np.array_equal(
            detection_probability([0.5, 30.0], model=slow, **one),
            detection_probability([0.5, 30.0], model=fast, **one),
        )


BAD = [
    ({"snr": -0.1}, r"snr is -0\.1: it must be a power ratio of 0 or more"),
    ({"snr": [1.0, np.nan]}, "snr is nan: it must be"),
    ({"snr": "loud"}, "snr is 'loud': it must be a number"),
    ({"false_alarm_probability": 0.0}, "false_alarm_probability is 0: it must lie strictly"),
    ({"false_alarm_probability": 1.0}, "false_alarm_probability is 1: it must lie strictly"),
    ({"false_alarm_probability": 1.5}, r"false_alarm_probability is 1\.5: it must lie strictly"),
    ({"false_alarm_probability": np.nan}, "false_alarm_probability is nan: it must lie strictly"),
    ({"pulses": 0}, "pulses is 0: it must be a whole number from 1"),
    ({"pulses": 1.5}, r"pulses is 1\.5: it must be a whole number from 1"),
    ({"pulses": np.inf}, "pulses is inf: it must be a whole number from 1"),
    ({"model": "swerlng1"}, r"model is 'swerlng1': .* \(nearest: 'swerling1'\)"),
    ({"model": 1}, "model is 1: it must be one of swerling0"),
    ({"method": "exakt"}, r"method is 'exakt': .* \(nearest: 'exact'\)"),
    ({"snr": [1.0, 2.0], "pulses": [1, 2, 3]}, "do not broadcast"),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_bad_input_is_named(change, message):
    arguments = {"snr": 1.0, "pulses": 2, "false_alarm_probability": 1e-3, **change}
    for function in (detection_probability, miss_probability):
        with pytest.raises(ValueError, match=message):
            function(**arguments)


def test_threshold_refuses_the_same():
    with pytest.raises(ValueError, match=r"pulses is 2\.5"):
        detection_threshold(2.5, 0.1)
    with pytest.raises(ValueError, match="false_alarm_probability is -1"):
        detection_threshold(2, -1.0)


def test_method_names():
    assert METHODS == ("exact", "table", "gram_charlier", "shnidman", "albersheim")
