"""Write itur_table.csv: values of the library ITU-Rpy, an independent reading of the same
Recommendations, frozen so that the tests need neither it nor a network.

Run where `pip install -e '.[oracle]'` has been done: python tests/atmosphere/make_itur_table.py
"""

import csv
import random
from pathlib import Path

import numpy as np
from itur.models import itu676, itu835, itu838, itu840


def gas(frequency_ghz, dry_pressure_hpa, temperature_k, vapour_density_g_m3):
    """ITU-Rpy takes the pressure as the dry one, as the formulas of P.676 do."""
    air = (frequency_ghz, dry_pressure_hpa, vapour_density_g_m3, temperature_k)
    model = itu676._ITU676_12_()
    return float(itu676.__gamma0_exact__(model, *air) + itu676.__gammaw_exact__(model, *air))


def table():
    """Return rows of quantity, up to four arguments ("" where there are fewer), and value."""
    rng = random.Random(7)
    rows = []
    for frequency in (
        1,
        10,
        22.235,
        35,
        50,
        57.6,
        60,
        77,
        94,
        118.75,
        140,
        183.31,
        220,
        325.15,
        350,
    ):
        for _ in range(4):
            case = (frequency, rng.uniform(50, 1050), rng.uniform(200, 310), rng.uniform(0, 20))
            rows.append(("gas", *case, gas(*case)))
    for frequency in (1, 5, 10, 24, 35, 77, 94, 140, 350, 1000):
        for tilt, elevation in ((0, 0), (90, 0), (45, 20), (0, 60), (30, 35)):
            rate = rng.choice((0.25, 5, 25, 100))
            k, alpha = itu838._ITU838_3_.rain_specific_attenuation_coefficients(
                frequency, elevation, tilt
            )
            rows.append(("rain", frequency, tilt, elevation, rate, float(k * rate**alpha)))
    for frequency in (1, 10, 35, 77, 94, 140, 200):
        for celsius in (-8, 0, 10, 20):
            k = itu840._ITU840_6_.specific_attenuation_coefficients(frequency, celsius)
            rows.append(("fog", frequency, celsius, "", "", float(k)))
    model = itu835._ITU835_6()
    for km in (0, 0.5, 3, 10.9, 11.1, 15, 19.9, 25, 33, 48, 60, 75):
        height = np.array(km)
        rows.append(("pressure", km, "", "", "", float(model.standard_pressure(height))))
        rows.append(("temperature", km, "", "", "", float(model.standard_temperature(height))))
    return rows


def main():
    with open(Path(__file__).with_name("itur_table.csv"), "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("quantity", "a", "b", "c", "d", "value"))
        writer.writerows((*row[:-1], f"{row[-1]:.16g}") for row in table())


if __name__ == "__main__":
    main()
