"""Faults of measured values: what their errors are drawn by, follow from, and are stated as."""

from fault import in_file

_GROUP = "measurements"
_VALUES = "wiring/test_measured_values.py"
_ERRORS = (
    "wiring/test_errors_of_measurement.py::test_the_error_of_one_quantity_tells_nothing_of_another"
)
_IN_CELL = "wiring/test_noise_lies_in_its_cell.py"
_VARIANCES = "wiring/test_variances_of_detections.py"

FAULTS = [
    *in_file(
        _GROUP, "components/sensor/measurement_errors.py", (_IN_CELL, _VARIANCES),
        ("places-of-noise-by-one-draw", "uniform(keys[noise], scan[noise], number)",
         "uniform(keys[noise], scan[noise], 0)"),
        ("cell-of-noise-by-its-edge", "np.rint(true[name][noise] / width)",
         "np.floor(true[name][noise] / width)"),
        ("noise-in-its-cell-errs-too", "drawn[name][noise] = 0.0",
         "drawn[name][noise] = drawn[name][noise]"),
        ("false-alarms-off-the-grid", "return self._valid(where), columns",
         "return dict(where), columns"),
    ),
    *in_file(
        _GROUP, "components/sensor/measurement_errors.py",
        "lockstep/test_errors_in_lock_step.py",
        ("errors-of-the-first-replica", "cells.instant_ns[found], cells.replica[found]",
         "cells.instant_ns[found], np.zeros_like(cells.replica[found])"),
    ),
    *in_file(
        _GROUP, "components/sensor/quantity_error.py", (_VALUES, _ERRORS),
        ("lasting-errors-alike", 'stream(f"lasting error of {name}")', 'stream("lasting error")'),
        ("errors-alike", 'stream(f"error of {name}")', 'stream("error")'),
        ("biases-alike", 'stream(f"bias of {name}")', 'stream("bias")'),
        ("stated-error-is-the-signal-s", "_OWN, _OF_SIGNAL = 0, 1", "_OWN, _OF_SIGNAL = 0, 0"),
        ("drawn-bias-stated-as-fixed", "(3.0 if drawn_bias else 1.0)",
         "(1.0 if drawn_bias else 1.0)"),
    ),
    *in_file(
        _GROUP, "components/radar/signal_errors.py", _VALUES,
        ("errors-by-stated-pulses", "ratio = p.pulses_summed * snr", "ratio = p.pulses * snr"),
        ("doppler-by-stated-dwell", "dwell_s = p.stated_dwell_s if look is None else look.dwell_s",
         "dwell_s = p.stated_dwell_s"),
        ("doppler-one-way", "wavelength_m / (2.0 * dwell_s)", "wavelength_m / dwell_s"),
    ),
    *in_file(
        _GROUP, "components/radar/radar_block.py", _VARIANCES,
        ("noise-only-recedes", "FASTEST_M_S * (2.0 * uniform - 1.0)", "FASTEST_M_S * uniform"),
    ),
    *in_file(
        _GROUP, "components/radar/swerling.py", _IN_CELL,
        ("ground-taken-for-the-target", "if cnr is not None:\n            pfa = np.empty",
         "if False:\n            pfa = np.empty"),
    ),
    *in_file(
        _GROUP, "components/radar/fading.py",
        "wiring/test_fluctuation_that_lasts.py::test_echoes_of_targets_with_models_of_their_own_"
        "scintillate_as_if_alone",
        ("aspect-of-whoever-comes-first",
         "x, y, z = unit_vector(azimuth[chosen], elevation[chosen])",
         "x, y, z = (v[: len(azimuth[chosen])] for v in unit_vector(azimuth, elevation))"),
    ),
    *in_file(
        _GROUP, "components/fusion/carried.py", "wiring/test_fused_and_tracked_positions.py",
        ("carried-away-from-the-ownship-s-way", "away * seen - step)", "away * seen + step)"),
    ),
]  # fmt: skip
