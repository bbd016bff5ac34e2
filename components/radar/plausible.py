"""Values of a radar's link budget that can be computed with and that no radar has."""

import math
from typing import Any

#: Key → least and largest value of radars that were built, and the unit.
_RANGES = {
    "frequency_hz": (3e6, 3e11, "Hz"),
    "wavelength_m": (1e-3, 100.0, "m"),
    "power_w": (1e-4, 1e8, "W"),
    "antenna_gain_db": (-3.0, 75.0, "dB"),
    "noise_figure_db": (0.0, 30.0, "dB"),
    "losses_db": (0.0, 50.0, "dB"),
    "integration_gain_db": (0.0, 70.0, "dB"),
    "bandwidth_hz": (1.0, 2e10, "Hz"),
}
#: Noise above the threshold in one look of a hundred is more than any radar's operator bears.
HIGH_FALSE_ALARM_PROBABILITY = 0.01
#: A false alarm in a million scans is none in any run.
NO_FALSE_ALARMS_PER_SCAN = 1e-6
#: Gain times beamwidths in square degrees.
GAIN_TIMES_BEAM = 30_000.0
MOST_GAIN_DISAGREEMENT_DB = 3.0
_PREFIXES = {1e3: "k", 1e6: "M", 1e9: "G", 1e-3: "m", 1e-6: "µ"}


def implausible(parameters: Any) -> list[str]:
    """Say which values no radar has, by their own names.

    Parameters
    ----------
    parameters : LinkBudgetParameters
    """
    found = []
    for key, (low, high, unit) in _RANGES.items():
        value = getattr(parameters, key)
        if value is None or low <= value <= high:
            continue
        text = f"{key} is {value:g} {unit}: implausible, radars have {low:g} to {high:g} {unit}"
        found.append(text + _other_unit(value, low, high, unit))
    return found


def _other_unit(value: float, low: float, high: float, unit: str) -> str:
    """Name a multiple of the unit in which the number would be plausible."""
    if unit == "dB":
        return ""
    for factor in (1e9, 1e6, 1e3, 1e-3, 1e-6):
        # Amid the range, not just inside it.
        if value > 0 and 10.0 * low <= value * factor <= high:
            return f" (is it {value:g} {_PREFIXES[factor]}{unit}, {value * factor:g} {unit}?)"
    return ""


def high_false_alarms(parameters: Any, snr_db: float) -> list[str]:
    """Say that a radar detects echoes below its noise because so many false alarms are allowed.

    Parameters
    ----------
    parameters : LinkBudgetParameters
    snr_db : float
        At which half of the looks detect.
    """
    pfa = parameters.false_alarm_probability
    if pfa < HIGH_FALSE_ALARM_PROBABILITY or not math.isfinite(snr_db):
        return []
    by_default = "false_alarm_probability" not in parameters.model_fields_set
    whose = "the thesis's, as the scene gives none" if by_default else "as the scene says"
    return [
        f"false_alarm_probability is {pfa:g} per look ({whose}): half of the looks at a target "
        f"detect at an SNR of {snr_db:.1f} dB; with 1e-6, as radars have, it takes far more"
    ]


def moved_threshold(parameters: Any, pd: float) -> list[str]:
    """Say what is left of a calibration's Pd where the threshold is not the one it was stated for.

    Parameters
    ----------
    parameters : LinkBudgetParameters
    pd : float
        Of the calibration's target at its range, with the threshold in use.
    """
    known = parameters.calibrate
    if known is None or parameters.calibrated_pfa == parameters.false_alarm_probability:
        return []
    return [
        f"calibrate holds at false_alarm_probability {parameters.calibrated_pfa:g} and the "
        f"threshold is set for {parameters.false_alarm_probability:g}: the hardware stays, and Pd "
        f"at {known.range_km:g} km is {pd:.3g} instead of {known.pd:g}"
    ]


def beam_against_gain(parameters: Any) -> list[str]:
    """Say that a beam and the antenna's gain contradict each other, where they do by over 3 dB.

    Parameters
    ----------
    parameters : LinkBudgetParameters

    Notes
    -----
    A gain of 30,000 over the product of the beamwidths in degrees is that of antennas as they are
    built (M. I. Skolnik, Introduction to Radar Systems, 3rd ed., section 9.2, has 26,000; C. A.
    Balanis, Antenna Theory, section 2.6, 30,000).
    """
    p = parameters
    widths_deg = p.azimuth_beamwidth_deg, p.elevation_beamwidth_deg
    whose = "azimuth_beamwidth_deg and elevation_beamwidth_deg are"
    if p.azimuth_beamwidth_deg is None:
        widths_deg = p.azimuth_resolution_deg, p.elevation_resolution_deg
        whose = "no beamwidths are given, and the grid that stands for the beam is"
    azimuth_deg, elevation_deg = widths_deg
    if not (azimuth_deg and elevation_deg):
        return []
    gain_db = 10.0 * math.log10(GAIN_TIMES_BEAM / (azimuth_deg * elevation_deg))
    if abs(gain_db - p.antenna_gain_db) <= MOST_GAIN_DISAGREEMENT_DB:
        return []
    alike_deg = math.sqrt(GAIN_TIMES_BEAM / 10.0 ** (0.1 * p.antenna_gain_db))
    return [
        f"antenna_gain_db is {p.antenna_gain_db:g}, which is a beam of {alike_deg:.3g} x "
        f"{alike_deg:.3g} deg, and {whose} {azimuth_deg:g} x {elevation_deg:g} deg, which is "
        f"{gain_db:.3g} dB: clutter, false alarms and what is told apart go by the beam"
    ]


def clutter_as_signal(parameters: Any, terrain: Any) -> list[str]:
    """Say that clutter raises detections where the threshold stays at the noise.

    Parameters
    ----------
    parameters : ClutterParameters
    terrain : Terrain or None
    """
    if terrain is None or parameters.clutter_threshold != "noise":
        return []
    return [
        "clutter_threshold is 'noise': the echo of the ground counts as signal, so that clutter "
        "raises detections; 'adaptive' keeps the probability of false alarm"
    ]


def unlikely_false_alarms(noise_key: str, pfa: float, cells: int, by_default: bool) -> list[str]:
    """Say how many false alarms a scan has where there are many, or practically none.

    Parameters
    ----------
    noise_key : str
        The key that sets how often noise crosses the threshold, and its value.
    pfa : float
        By look and cell, as the threshold has it.
    cells : int
        Resolution cells of a scan.
    by_default : bool
        Whether the key has the value that it has where nobody gives one.
    """
    comes_to = (
        f"with {cells:,} resolution cells that makes {cells * pfa:,.3g} false alarms per scan"
    )
    if pfa >= HIGH_FALSE_ALARM_PROBABILITY:
        whose = " (the thesis's, as the scene gives none)" if by_default else ""
        return [
            f"false_alarms is true and {noise_key}{whose}: {comes_to}, {pfa:.3g} in every cell; "
            "radars have 1e-6 per cell or less"
        ]
    if cells * pfa < NO_FALSE_ALARMS_PER_SCAN:
        return [
            f"false_alarms is true and {noise_key}: {comes_to}, practically none; targets and "
            "noise cross one threshold, and a lower one has both come more often"
        ]
    return []


def noise_at_targets(parameters: Any) -> list[str]:
    """Say that looks which noise decides are reported at the target's own place, where they are.

    Parameters
    ----------
    parameters : LinkBudgetParameters
    """
    steps = ("azimuth_resolution_deg", "elevation_resolution_deg", "range_resolution_m")
    exact = [step for step in steps if getattr(parameters, step) == 0]
    if parameters.errors != "grid" or not exact:
        return []
    return [
        f"noise that is taken for a target: {exact[0]} is 0, so it is reported exactly where the "
        "target is (thesis); a grid has the cell's place, errors = 'signal' any place in the cell"
    ]
