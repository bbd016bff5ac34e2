"""``python -m docs.make.sensors.reception FILE [FIGURE]``: reception, beside 23 receivers.

FILE is regression_models.csv of fazlurnu/adsb_reception_model_opensky, which is not part of the
project.
"""

import argparse
import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np

from components.surveillance.reception import (
    AIRCRAFT_AROUND,
    AIRPORTS_AROUND,
    FITTED_RANGE_M,
    fitted_reception_probability,
)
from dsa_des.block.mark import BLUE, ORANGE
from dsa_des.record.drawing import draw_to_png
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say_lines

#: Aircraft and airports around: few, the default's, many.
AROUND = ((20.0, 50.0), (50.0, 50.0), (AIRCRAFT_AROUND, AIRPORTS_AROUND), (200.0, 50.0))
_X = np.linspace(0.0, 1.0, 101)


def receivers(path: Path) -> tuple[list[dict[str, str]], Any]:
    """Return the rows of the published regressions, and their parameters, (receivers, 4, 3)."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    numbers = [row["Best Parameters"].strip("[]").split() for row in rows]
    return rows, np.array(numbers, dtype=float).reshape(-1, 4, 3)


def curves(parameters: Any, aircraft: float, airports: float) -> Any:
    """Return what each receiver's regression says over the range, (receivers, 101)."""
    by_order = parameters @ np.array([aircraft, airports, 1.0])
    sums = 1.0 + by_order @ np.stack([_X**n for n in (1, 2, 3, 4)])
    return np.clip(np.exp(-3.0 * _X**2) * sums, 0.0, 1.0)


def off_percent(parameters: Any, aircraft: float, airports: float) -> Any:
    """Return how far the law is off each receiver's regression, rms over range, %."""
    law = fitted_reception_probability(_X * FITTED_RANGE_M, aircraft, airports)
    return 100.0 * np.sqrt(((curves(parameters, aircraft, airports) - law) ** 2).mean(axis=1))


def table(path: Path) -> str:
    """Return the table of all receivers."""
    rows, parameters = receivers(path)
    columns = [off_percent(parameters, *around) for around in AROUND]
    text = "| receiver | of its own test | "
    text += " | ".join(f"{aircraft:g} aircraft" for aircraft, _ in AROUND) + " |\n"
    text += "|---" * (2 + len(AROUND)) + "|\n"
    for number, row in enumerate(rows):
        values = " | ".join(f"{column[number]:.1f}" for column in columns)
        text += f"| {row['Sensor Type']} {row['Sensor ID']} | {float(row['RMSE (Test) %']):.1f} "
        text += f"| {values} |\n"
    together = [float(np.sqrt((column**2).mean())) for column in columns]
    return text + f"| all together | | {' | '.join(f'{one:.1f}' for one in together)} |\n"


def draw(path: Path, out: Path) -> None:
    """Draw the law over all receivers' curves, for few, the default's, and many aircraft."""
    rows, parameters = receivers(path)
    shown = (AROUND[0], AROUND[2], AROUND[3])
    with draw_to_png(9.5, 3.4, out) as figure:
        for axes, around in zip(figure.subplots(1, 3, sharey=True), shown, strict=True):
            range_nmi = _X * FITTED_RANGE_M / 1852.0
            for row, curve in zip(rows, curves(parameters, *around), strict=True):
                make = ORANGE if row["Sensor Type"] == "Radarcape" else "0.7"
                axes.plot(range_nmi, curve, color=make, linewidth=0.7)
            axes.plot(
                range_nmi,
                fitted_reception_probability(_X * FITTED_RANGE_M, *around),
                color=BLUE,
                linewidth=2.0,
            )
            axes.set_title(f"{around[0]:g} aircraft, {around[1]:g} airports", fontsize=9)
            axes.set_xlabel("range (nmi)")
        figure.axes[0].set_ylabel("probability of reception")
        figure.tight_layout()


def main(arguments: list[str] | None = None) -> int:
    """Print the table, and draw the figure where one is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("figure", type=Path, nargs="?")
    options = parser.parse_args(arguments)
    say_lines(table(options.file).rstrip())
    if options.figure:
        draw(options.file, options.figure)
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
