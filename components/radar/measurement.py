"""Measured strength of a radar's detections, and the errors of measurement that follow from it."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from components.arguments.checks import check_not_negative, check_positive
from components.geometry import NEAR_A_POLE_DEG, rotate_to_meridian
from components.messages.columns import OWN_VELOCITY
from components.messages.detections import REPORT, Detections, ReportTransform
from components.messages.targets import RelativeTargets, own_velocity_ned_m_s
from components.radar.detection.detector_output import measured_snr_given_detection
from components.radar.link_budget import wavelength
from components.sensor.look import STRENGTH, Cells, Look, Strengthening
from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.block.effect import Effect, Verdict
from dsa_des.errors import Disagreements

#: Slope of the difference pattern over the sum pattern, in beamwidths (Barton).
MONOPULSE_SLOPE = 1.6
#: Of a beam that scans over the target, and what its pattern takes from the pulses' energy.
SCAN_SLOPE = 1.66
SCAN_BEAMSHAPE_LOSS = 1.33
#: A measurement is somewhere in its cell.
_UNIFORM = 1.0 / 12.0


def angle_variance(
    beamwidth_rad: float, energy_ratio: FloatArray, *, method: str = "monopulse"
) -> FloatArray:
    """Return the variance of an angle measured with one beam or a pair of them, rad².

    By the energy ratio, S/N of a pulse times the number of pulses; at most beamwidth²/12.

    ``monopulse``: sigma = beamwidth / (k_m sqrt(2 n S/N)), k_m = 1.6, of a target near the axis.
    ``scan``: sigma = beamwidth / (k sqrt(2 n S/N / L_p)), k = 1.66, L_p = 1.33 the beamshape loss.
    Barton & Leonov, Radar Technology Encyclopedia, Artech House 1997, "accuracy of monopulse,
    fundamental" and "accuracy of sequential lobing, fundamental"; Curry, Radar System Performance
    Modeling, 2nd ed., Artech House 2005, section 8.2, has the former.
    """
    width = float(check_positive("beamwidth_rad", beamwidth_rad))
    ratio = _checked_energy_ratio(energy_ratio)
    if method == "monopulse":
        return _limited_variance(width, ratio, MONOPULSE_SLOPE)
    if method == "scan":
        return _limited_variance(width, ratio / SCAN_BEAMSHAPE_LOSS, SCAN_SLOPE)
    raise ValueError(f"method is {method!r}: it must be 'monopulse' or 'scan'")


def range_variance(range_resolution_m: float, energy_ratio: FloatArray) -> FloatArray:
    """Return the variance of a range measured with a resolution c / 2B, m², at most resolution²/12.

    sigma = resolution / sqrt(2 n S/N): Curry, section 8.1; Mahafza, Radar Systems Analysis and
    Design Using MATLAB, has it with the rms bandwidth. That of a flat spectrum of width B, by
    Skolnik, Theoretical accuracy of radar measurements, IRE Trans. ANE-7, 1960, would be smaller by
    sqrt(3) / pi, which a receiver with weighting does not reach.
    """
    return _limited_variance(
        float(check_positive("range_resolution_m", range_resolution_m)),
        _checked_energy_ratio(energy_ratio),
    )


def range_rate_variance(range_rate_resolution_m_s: float, energy_ratio: FloatArray) -> FloatArray:
    """Return the variance of a range rate measured by its Doppler shift, at most resolution²/12.

    sigma = resolution / sqrt(2 n S/N), resolution = wavelength / (2 coherent time): Curry, section
    8.3.
    """
    step = float(check_positive("range_rate_resolution_m_s", range_rate_resolution_m_s))
    return _limited_variance(step, _checked_energy_ratio(energy_ratio))


def _checked_energy_ratio(energy_ratio: FloatArray) -> FloatArray:
    ratio: FloatArray = np.asarray(check_not_negative("energy_ratio", energy_ratio))
    return ratio


def _limited_variance(width: float, ratio: FloatArray, slope: float = 1.0) -> FloatArray:
    least = 1.0 / (2.0 * slope**2 * _UNIFORM)
    variance: FloatArray = width**2 / (2.0 * slope**2 * np.maximum(ratio, least))
    return variance


def signal_over_noise_and_clutter(snr: FloatArray, cnr: FloatArray | None) -> dict[str, FloatArray]:
    """Return SNR / (1 + CNR), or the SNR without clutter, under the key `snr`.

    It is the SNR that the decision rested on and that is recorded: the mean one of a fluctuating
    target, or that of its sampled cross-section. A radar knows it from the height of the echo, to
    about 1 dB where it detects. As errors are drawn by the same number, variances are honest.
    """
    return {"snr": snr if cnr is None else snr / (1.0 + cnr)}


def signal_variances(p: Any, snr: FloatArray) -> dict[str, FloatArray]:
    """Variances of azimuth, elevation (rad²), range (m²), range rate (m²/s²) by SNR per pulse."""
    ratio = p.pulses_summed * snr
    variances = {
        angle: angle_variance(math.radians(width_deg), ratio, method=p.angle_measurement)
        for angle, width_deg in (
            ("azimuth", p.azimuth_beamwidth_deg),
            ("elevation", p.elevation_beamwidth_deg),
        )
    }
    variances["range"] = range_variance(p.range_resolution_m, ratio)
    if (step := _range_rate_resolution_m_s(p)) is not None and p.measures_range_rate:
        variances["range_rate"] = range_rate_variance(step, ratio)
    return variances


def check_signal_errors(p: Any) -> None:
    """Raise ValueError if ``errors = 'signal'`` and a beamwidth or a resolution is missing."""
    if p.errors != "signal":
        return
    wrong = [
        f"errors is 'signal' and {key} is not given: errors of angles are a share of the beam"
        for key in ("azimuth_beamwidth_deg", "elevation_beamwidth_deg")
        if getattr(p, key) is None
    ]
    if not p.range_resolution_m:
        wrong.append(
            "errors is 'signal' and range_resolution_m is 0: errors of range are a share of it, it "
            "must be above 0"
        )
    if p.measures_range_rate and _range_rate_resolution_m_s(p) is None:
        wrong.append(
            "errors is 'signal', measures_range_rate is true and neither "
            "range_rate_resolution_m_s nor the time of a look (dwell_s, or pulses_per_dwell and "
            "prf_hz) is given: errors of range rate are a share of what Doppler resolves"
        )
    Disagreements.raise_if_any(wrong)


def _range_rate_resolution_m_s(p: Any) -> float | None:
    """Return range rate resolution, given or from the dwell time, m/s; None if unknown."""
    if p.range_rate_resolution_m_s:
        return float(p.range_rate_resolution_m_s)
    look = p.look_energy
    dwell_s = p.stated_dwell_s if look is None else look.dwell_s
    if not dwell_s:
        return None
    wavelength_m = p.wavelength_m or wavelength(p.frequency_hz)
    return float(wavelength_m / (2.0 * dwell_s))


#: Noise may barely cross a low threshold; -60 dB stands for nothing.
FAINTEST = 1e-6


class Strength:
    """Gives the output that crossed the threshold."""

    def __init__(self, block: Any) -> None:
        self._block = block
        self._draws = block.stream("measured strength")

    def __call__(self, cells: Cells, detected: IntArray, look: Look) -> Look:
        """Return the look with the measured strength of its detected cells."""
        if "snr" not in look.signal:  # a radar of one's own that says no strength
            return look
        block = self._block
        extras = {name: v for name, v in look.extras.items() if name != "detection_probability"}
        if look.tail is None:
            keys = cells.roster.draw_keys_of(cells.target[detected])
            draws = self._draws.of_runs(cells.run[detected], cells.instant_ns[detected])
            tail = 1.0 - draws.uniform(keys, cells.scan[detected])
        else:
            tail = look.tail[detected]
        # Clutter is more noise to the output, as it is to the mean; a threshold that stays at the
        # noise takes it for signal.
        mean = look.signal["snr"][detected]
        floor = np.ones(len(detected))
        if block.p.clutter_threshold == "noise":
            with np.errstate(divide="ignore", invalid="ignore"):
                over_noise = 10.0 ** (0.1 * extras["snr_db"][detected]) / mean
            floor = np.where(mean > 0.0, over_noise, floor)
        snr = np.empty(len(detected))
        for crossing, part in block.crossings_with_positions(cells, detected):
            for model, chosen in block.swerling_models_and_cells(cells):
                some = part
                if not isinstance(chosen, slice):  # else one model for all
                    some = part[_positions_of_chosen(detected[part], chosen, len(cells))]
                output = 1.0 + measured_snr_given_detection(
                    tail[some],
                    mean[some],
                    threshold=crossing.threshold / floor[some],
                    pulses=crossing.pulses,
                    model=f"swerling{model}",
                )
                snr[some] = np.maximum(output * floor[some] - 1.0, 0.0)
        snr_db, confidence = extras["snr_db"].copy(), look.confidence.copy()
        snr_db[detected] = 10.0 * np.log10(np.maximum(snr, FAINTEST))
        confidence[detected] = snr_db[detected] - block.confidence_zero_snr_db()
        signal: FloatArray = look.signal["snr"].copy()
        signal[detected] = snr
        return replace(
            look, extras={**extras, "snr_db": snr_db}, confidence=confidence, signal={"snr": signal}
        )


class MeasuredStrength(Effect[Strengthening]):
    """A detection's SNR and confidence are measured: the output that crossed the threshold.

    SNR and confidence of a detection are those of the output that crossed the threshold, by the
    target's own fluctuation and the noise of that look; errors by signal follow from that output
    too. The probability of detection, which only the truth gives, is left out; ``looks`` has what
    decided. Where the draw of a look decides, the same draw says how strong it came out.
    """

    name = "measured strength"
    acts_on = STRENGTH
    builds = Strength
    outside_the_proof = "a radar always measures strength"

    def verdict(self, block: Any) -> Verdict:
        """Return whether signal strength is measured: needs a radar that is switched on."""
        if not block.p.enabled:
            return Verdict(False, "enabled is false")
        return Verdict(True, "a radar measures strength as it measures places")


def _positions_of_chosen(cells: IntArray, chosen: IntArray, count: int) -> IntArray:
    """Return the positions in `cells` whose cell is among the chosen ones."""
    inside = np.zeros(count, dtype=bool)
    inside[chosen] = True
    return np.flatnonzero(inside[cells])


def noise_report_warnings(parameters: Any) -> list[str]:
    """Return a warning in a list if noise in a target's cell is reported exactly at the target."""
    steps = ("azimuth_resolution_deg", "elevation_resolution_deg", "range_resolution_m")
    exact = [step for step in steps if getattr(parameters, step) == 0]
    if parameters.errors != "grid" or not exact:
        return []
    return [
        f"noise that is taken for a target: {exact[0]} is 0, so it is reported exactly where the "
        "target is (thesis); a grid has the cell's place, errors = 'signal' any place in the cell"
    ]


class OwnVelocity(Effect[ReportTransform]):
    """The ownship's ground velocity reported with all detections, without navigation error.

    A range rate is of two aircraft: an estimate of the other one's velocity from it needs ours.
    """

    name = "own velocity"
    acts_on = REPORT
    flag = "measures_range_rate"
    outside_the_proof = "it fills columns that are null without it"

    def build(self, block: Any) -> ReportTransform:
        """Return a function that adds the own velocity to a report."""
        ticks_per_s = block.context.ticks_per_s

        def with_velocity(
            detections: Detections, targets: RelativeTargets, rows: IntArray
        ) -> Detections:
            counts = np.diff(detections.offsets)
            after, some = detections.ticks_after, counts > 0
            # At instants of their own, or once a scan.
            row = rows[some] if after is None else np.repeat(rows, counts)
            state = targets.position_ticks[row]
            time_s = (state if after is None else state + after) / ticks_per_s
            velocity = _rotate_to_believed_north(
                own_velocity_ned_m_s(targets, row, time_s), targets, row, time_s
            )
            if after is not None:
                own = dict(zip(OWN_VELOCITY, velocity, strict=True))
                return replace(detections, own_velocity_of_entries=own)
            of_scans = np.full((len(OWN_VELOCITY), len(rows)), np.nan)
            of_scans[:, some] = velocity
            return replace(detections, own_velocity=dict(zip(OWN_VELOCITY, of_scans, strict=True)))

        return with_velocity


def _rotate_to_believed_north(
    velocity: FloatArray, targets: RelativeTargets, row: IntArray, time_s: FloatArray
) -> FloatArray:
    """Return the ownship's velocity along north and east of where it believes to be."""
    believed, flights = targets.believed, targets.revisit
    if believed is None or flights is None or not len(row):
        return velocity
    place = believed["lat_deg"][row], believed["lon_deg"][row]
    if not (np.abs(place[0]) > NEAR_A_POLE_DEG).any():
        return velocity
    own = flights.viewer_states(row, time_s)
    return rotate_to_meridian(velocity, (own.lat_deg, own.lon_deg), place)
