"""``python -m docs.make.sensors.lasers``: print the tables of docs/sensors.md that are computed."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from components.laser.range_equation import (
    beam_share_on_wire,
    mean_shots_on_target,
    received_laser_power_w,
    scan_detection_probability,
)
from components.optical.detection import deviations_of_exceedance

LASER = Path(__file__).parents[3] / "configs/sensors/wire_laser.toml"
#: Published: a name, the wire's diameter (mm) and the range from which it is detected (m).
PUBLISHED = (("Hellas-W/HR", 10.0, 600.0), ("Hellas-A", 5.0, 750.0))
SPAN_M, REFLECTIVITY, WITHIN = 100.0, 0.2, 0.995


def wire_within_a_second(diameter_mm: float, range_m: float, power: float = 1.0) -> float:
    """Return the probability that our laser detects 100 m of wire across it within a second."""
    with LASER.open("rb") as file:
        p: dict[str, Any] = tomllib.load(file)
    beam_rad, thick_m = 1e-3 * p["divergence_mrad"], 1e-3 * diameter_mm
    echo_w = received_laser_power_w(
        beam_share_on_wire(thick_m, range_m, beam_rad), range_m,
        peak_power_w=power * p["peak_power_w"],
        aperture_m=1e-3 * p["aperture_mm"], efficiency=p["efficiency"],
        reflectivity=REFLECTIVITY,
    )  # fmt: skip
    width, height = (np.ptp(np.radians(p[f"{axis}_deg"])) for axis in ("azimuth", "elevation"))
    length_rad = SPAN_M / range_m
    shots = mean_shots_on_target(
        length_rad * thick_m / range_m, 0.25 * np.pi * length_rad * beam_rad,
        width * height / (p["azimuth_shots"] * p["elevation_shots"]),
    )  # fmt: skip
    threshold = deviations_of_exceedance(p["false_alarm_probability"])
    pd = scan_detection_probability(
        echo_w / p["noise_equivalent_power_w"], shots, threshold=threshold
    )
    return float(1.0 - (1.0 - pd) ** p["scan_rate_hz"])


def _where(reached: Any, low: float, high: float) -> float:
    """Return the largest argument at which something that falls is reached."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reached(middle) else (low, middle)
    return low


def wires() -> list[str]:
    """Return the rows of published wires beside ours."""
    rows = []
    for name, diameter_mm, range_m in PUBLISHED:
        pd = wire_within_a_second(diameter_mm, range_m)
        reach_m = _where(lambda r, d=diameter_mm: wire_within_a_second(d, r) >= WITHIN, 50.0, 2e3)
        power = 1.0 / _where(
            lambda x, d=diameter_mm, r=range_m: wire_within_a_second(d, r, 1.0 / x) >= WITHIN,
            1e-3, 1e3,
        )  # fmt: skip
        rows.append(
            f"| {name} | {diameter_mm:g} mm | {range_m:g} m | {WITHIN:g} | {pd:.2g} | "
            f"{reach_m:.0f} m | {power:.2f} |"
        )
    return rows


if __name__ == "__main__":
    print("\n".join(wires()))
