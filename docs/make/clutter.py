"""``python -m docs.make.clutter docs/clutter.md``: make the page and its figure."""

import argparse
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from components.arguments.units import SPEED_OF_LIGHT_M_S
from components.atmosphere.rain_echo import rain_reflectivity_per_m, rain_volume_m3
from components.radar.detection.cfar import cfar_loss_db
from components.radar.doppler import MovingTargetFilter
from components.thesis.drawing import GREY, draw_legend_below, panels_written_as_png
from components.thesis.drawing import RADAR as RADAR_COLOUR
from docs.make.stamp import stamped
from dsa_des.block.mark import BLUE, PINK
from dsa_des.files.output_file import write_file
from dsa_des.library.runs import run
from dsa_des.terminal.interruption import exit_plainly_on_signal

#: A radar with a carrier and PRF for Doppler, a gain that is its beam's, and a Pfa as radars have.
RADAR: dict[str, Any] = {
    "type": "radar.swerling", "scan_rate_hz": 20, "power_w": 2.0, "antenna_gain_db": 35.7,
    "frequency_hz": 10e9, "calibrate": {"rcs_dbsm": 3.01, "range_km": 5.0, "pd": 0.5},
    "false_alarm_probability": 1e-6, "reference_pd": 0.5, "azimuth_beamwidth_deg": 2.0,
    "elevation_beamwidth_deg": 4.0, "azimuth_resolution_deg": 2.0, "elevation_resolution_deg": 4.0,
    "range_resolution_m": 50.0, "prf_hz": 7000.0, "range_km": 12.0, "budget": "free",
}  # fmt: skip
OWN_MPS, HEIGHT_M, BELOW_M, AWAY_M = 50.0, 600.0, 500.0, 9000.0


def scene(
    radar: Mapping[str, Any], gamma_db: float | None, target_mps: float, *, seed: int = 1
) -> dict[str, Any]:
    """Return an encounter head-on: the intruder flies low, the ownship at 50 m/s above it."""
    # A key of None leaves out one of RADAR's.
    table = {key: value for key, value in {**RADAR, **radar}.items() if value is not None}
    own = {
        "lat_deg": 52.0, "lon_deg": 4.4, "alt_m": HEIGHT_M, "heading_deg": 0.0,
        "speed_mps": OWN_MPS,
    }  # fmt: skip
    low = {
        "name": "low", "east_m": 0.0, "north_m": AWAY_M, "up_m": -BELOW_M, "heading_deg": 180.0,
        "speed_mps": target_mps, "rcs_dbsm": 3.01, "swerling": 1,
    }  # fmt: skip
    terrain = {"height_m": 0.0, "clutter_motion_m_s": 0.3}
    if gamma_db is not None:
        terrain["clutter_gamma_db"] = gamma_db
    return {
        "duration_s": round((AWAY_M - 400.0) / (OWN_MPS + target_mps), 1), "seed": seed,
        "wires": ["traffic -> transform -> gate", "gate -> radar"],
        "blocks": {
            "traffic": {"type": "traffic.scripted", "ownship": own, "intruders": [low]},
            "transform": {"type": "geometry.ellipsoid"}, "gate": {"type": "gate"}, "radar": table,
        },
        **({} if gamma_db is None else {"terrain": terrain}),
    }  # fmt: skip


def half_range_m(
    radar: Mapping[str, Any], gamma_db: float | None, target_mps: float = 60.0
) -> float:
    """Return the farthest range at which one look in two detects the intruder, m; NaN if none."""
    asked = {**scene(radar, gamma_db, target_mps), "record": {"looks": True}}
    rows = run(asked)["looks"].to_pydict()
    range_m = np.array(rows["true_range_m"], dtype=np.float64)
    pd = np.array(rows["detection_probability"], dtype=np.float64)
    good = pd >= 0.5
    return float(range_m[good].max()) if good.any() else math.nan


def detections(radar: Mapping[str, Any], gamma_db: float | None, seeds: int) -> float:
    """Return the mean number of detections of an encounter at 60 m/s."""
    found = [
        run(scene(radar, gamma_db, 60.0, seed=seed))["detections"].num_rows
        for seed in range(1, seeds + 1)
    ]
    return float(np.mean(found))


FIGURE = "clutter.png"
_GAMMAS_DB = (-60, -55, -50, -45, -40, -35, -30, -25, -20, -15, -10)
_SPEEDS_M_S = (0, 1, 2, 3, 4, 6, 8, 10, 12, 15, 20, 25, 30, 40, 52, 65, 75, 85, 92, 96, 100, 102,
               105, 108, 110, 113, 116, 120, 130)  # fmt: skip
_WAYS: tuple[tuple[str, Mapping[str, Any], str, str], ...] = (
    ("threshold known exactly", {}, GREY, "-"),
    ("CFAR, 16 cells", {"cfar_reference_cells": 16}, RADAR_COLOUR, "-"),
    ("CFAR and double canceller",
     {"cfar_reference_cells": 16, "moving_target_filter": "double_canceller"}, BLUE, "-"),
    ("CFAR and filter bank",
     {"cfar_reference_cells": 16, "moving_target_filter": "filter_bank"}, PINK, "-"),
    ('clutter_threshold = "noise"', {"clutter_threshold": "noise"}, GREY, ":"),
)  # fmt: skip

_HEAD = """# Thresholds, clutter and Doppler

How far does a radar see over ground and in rain, with which filter, and how many of its reports
are false?

> `dsa-des run first_light --set terrain.height_m=0 --set weather.rain_rate_mm_h=4`
> `--set blocks.radar.false_alarms=true --set blocks.radar.false_alarm_probability=1e-6`

![Range of Pd 0.5 over reflectivity of the ground, and over speed](images/{figure})

The picture is that of an [encounter below](#effect-on-range); keys are in the
[reference](reference.md).

## One threshold

`false_alarm_probability` is that of one look at one resolution cell. It sets the threshold that
detections cross, and with `false_alarms = true` noise crosses it in every cell of the field of
view: a scan has (cells · Pfa) false alarms on average. The thesis's 0.05 is meant for a look at a
target; with false alarms it fills one cell in twenty, and `check` and `run` warn of it:

```text
false_alarms is true and false_alarm_probability is 0.05: with 15,000 resolution cells that makes
750 false alarms per scan, 0.05 in every cell; radars have 1e-6 per cell or less
```

A range that calibrates a radar (`calibrate`) holds at the probability of false alarm of the file
that states it, or at `calibrate.false_alarm_probability`. A lower `false_alarm_probability` in a
scene, with `--set` or in a study raises the threshold; the hardware stays the same, Pd at that
range falls, and `check` gives its value.

A `radar.threshold` has the false alarms of its `threshold_db`, whatever the
`false_alarm_probability`.

A target far below the noise is reported with the probability of false alarm. Such a report lies in
the target's resolution cell and has no more information: on a grid it has the grid point of the
cell; with `errors = "signal"`, it is uniform over the cell (with that variance), also if the cell
is wider than the grid. With a resolution of 0 there is no cell, and reports are exact, as in the
thesis.

Targets in one resolution cell (beam or grid step, by range) make one report: that of the strongest
echo, with the sum of their powers. This is the default if `errors` is not `"grid"` and
cells have a size, and with `resolution_cells = true`; with `false`, and in the thesis, each target
has its own. Filters do not separate two targets of one cell.

## Clutter

`[terrain] height_m` gives flat ground an echo (constant gamma, `clutter_gamma_db`) in the range
cell of each target, as far as the beam meets it. The threshold rises with it (`clutter_threshold
= "adaptive"`, the default): the false alarms stay what they are, a target needs its SNR over
noise *and* clutter, and every radar sees less far. With `"noise"` the threshold stays where noise
alone has it: clutter is detected as if it were the target, and with `false_alarms` the ground is
reported in every cell in which it crosses.

By default the mean power of noise and clutter is known. A real radar averages the cells around:
`cfar_reference_cells` has it do so (cell-averaging CFAR), at the loss of so few ({loss_8:.1f} dB
with 8 cells, {loss_16:.1f} dB with 16, {loss_64:.1f} dB with 64, at Pfa 1e-6, Pd 0.5 and Swerling
I). Edges of clutter, and other targets among the cells, are left out.

`radar.range_boundary` has neither noise nor a threshold. Its boundary is taken as the range of
one target (`boundary_rcs_dbsm`, `boundary_pd`, `false_alarm_probability`); clutter and the CFAR
loss then bring it nearer, if its cells have a size. With `frequency_hz` it obeys the weather too;
without, `check` says that no weather changes it.

## Beams

`azimuth_beamwidth_deg` and `elevation_beamwidth_deg` are the width of the beam, `range_cell_m`
the depth of a cell; the grid of reports (`azimuth_resolution_deg` and so on) is the step of
reported values, and replaces a beam only if none is given. Clutter, the number of false alarms
and the separation of targets depend on the beam. A gain is 30,000 over the product of its
beamwidths in degrees; where the two contradict each other by more than 3 dB, `check` says so.

- `sidelobe_level_db`: ground and rain at the target's range all around, at a mean level below the
  beam (a ring of 2π R ΔR of ground, and of rain a shell). By default there are no sidelobes.
- `beam_shape_loss`: a target between the scan's beams loses what their shape takes, 6 dB at half a
  beamwidth both ways; a beam that sweeps in azimuth has its mean over the pulses, 1.67 dB. Off by
  default: a range that was flown has it in it.

## Rain

`[weather] rain_rate_mm_h` attenuates, and echoes: η = π⁵ |K|² Z / λ⁴ with Z = 200 R^1.6, times the
volume of a Gaussian beam, π R² θ φ ΔR / (8 ln 2), as far as it rains there (`rain_top_m`, and the
ground). Of the radar below, at 5 km and 3 cm, by rain rate:

{rain}

Drops scatter after Rayleigh: up to 35 GHz, where the formula is within 4 dB of Mie's up to 25
mm/h; above, `check` warns that it gives too much. A linearly polarised antenna receives all of it;
a circularly polarised one rejects `rain_rejection_db`. Rain is noise that differs from look to
look, and from pulse to pulse. Before a filter it moves with the wind and falls (2.6 Z^0.107 m/s),
spread by turbulence (1 m/s), shear over the beam (0.42 · 4 m/s/km · R φ) and the platform: a notch
that is locked to the ground leaves rain that the wind blows. An average of cells follows rain as
it follows the ground, and a fixed threshold reports it in every cell. A radar whose cells have no
size receives no rain, and `check` warns of it.

## Doppler

`moving_target_filter` (with `prf_hz`) combines successive pulses so that echoes that move like the
ground cancel: `single_canceller`, `double_canceller`, or a `filter_bank` of `filter_pulses` pulses
whose filters near the ground are not used (`notch_m_s`). The notch follows the range rate of the
ground in the beam (`clutter_lock`), as the ownship flies over it: a target is lost when its *own*
velocity over ground has no part along the line of sight, and at the blind speeds, multiples of
λ·PRF/2. Measured range rates are the true ones, as if ambiguities were resolved by several PRF;
with `range_rate_folds = true` they fold at the unambiguous velocity, λ·PRF/4. The residual clutter
follows from its spread: the beam's width across the ownship's course (0.3 · speed · beamwidth ·
sin), the ground's own motion (`[terrain] clutter_motion_m_s`), and `improvement_limit_db`.
Cancellers keep the SNR of targets of all speeds on average, and gain for some; a bank
loses {bank_loss:.1f} dB on average by its window and between its filters.

## Effect on range

An intruder of 3 dBsm (Swerling I) flies 100 m above the ground towards an ownship 500 m higher,
which flies at 50 m/s. The radar (10 GHz, PRF {prf:g} Hz, beam 2 by 4 deg, cells of 50 m, Pfa 1e-6)
has Pd 0.5 at 5 km without clutter. Every point is the farthest range with Pd 0.5 in the
rows of one run (`docs/make/clutter.py`).

In the [picture](images/{figure}), left: clutter takes two thirds of the range at -20 dB; behind
a filter, little of it. A threshold that stays at the noise would have it grow. Right, over ground
of -20 dB: the notch at 0, and the blind speed of {blind:.0f} m/s, which an intruder that is seen at
1 km only, 30 deg below, has along the line of sight when it flies 15 % faster.

Detections of such an encounter, {seeds} runs each:

"""


def page(images: Path, *, seeds: int = 10) -> str:
    """Run the scenes, draw the figure and return the page."""
    draw(images / FIGURE)
    found = MovingTargetFilter("filter_bank", RADAR["prf_hz"], wavelength_m())
    speeds = [(i + 0.5) / 500 * found.blind_speed_m_s for i in range(500)]
    bank_loss = -10.0 * math.log10(float(np.mean(found.target_and_clutter_gains(speeds)[0])))
    losses = {
        f"loss_{cells}": cfar_loss_db(0.5, reference_cells=cells, false_alarm_probability=1e-6)
        for cells in (8, 16, 64)
    }
    text = _HEAD.format(
        figure=FIGURE, prf=RADAR["prf_hz"], blind=found.blind_speed_m_s, bank_loss=bank_loss,
        seeds=seeds, rain="\n".join(rain_table()), **losses,
    )  # fmt: skip
    return text + "\n".join(table(seeds)) + "\n"


def rain_table() -> list[str]:
    """Return the lines of the table of rain: its reflectivity, and its RCS beside a target."""
    beams = [math.radians(RADAR[f"{axis}_beamwidth_deg"]) for axis in ("azimuth", "elevation")]
    volume_m3 = rain_volume_m3(
        5000.0, 0.0, 0.0, azimuth_beamwidth_rad=beams[0], elevation_beamwidth_rad=beams[1],
        range_resolution_m=RADAR["range_resolution_m"], lowest_m=-math.inf, highest_m=math.inf,
    )  # fmt: skip
    lines = ["| rain, mm/h | Z, dBZ | η, dB m²/m³ | in the cell, dBsm |", "|---|---|---|---|"]
    for rate in (1.0, 4.0, 16.0, 25.0):
        eta = rain_reflectivity_per_m(rate, wavelength_m())
        z_db = 10.0 * math.log10(200.0 * rate**1.6)
        cells = f"{z_db:.1f} | {10 * math.log10(eta):.1f} | {10 * math.log10(eta * volume_m3):.1f}"
        lines.append(f"| {rate:g} | {cells} |")
    return lines


def wavelength_m() -> float:
    """Return the wavelength of the page's radar."""
    return SPEED_OF_LIGHT_M_S / float(RADAR["frequency_hz"])


def table(seeds: int) -> list[str]:
    """Return the lines of the table: detections without clutter, and with two kinds of ground."""
    grounds = (None, -20.0, -10.0)
    lines = ["| radar | no clutter | gamma -20 dB | gamma -10 dB |", "|---|---|---|---|"]
    for name, keys, _, _ in _WAYS:
        counts = [f"{detections(keys, gamma_db, seeds):.0f}" for gamma_db in grounds]
        lines.append(f"| {name} | " + " | ".join(counts) + " |")
    return lines


def draw(path: Path) -> None:
    """Draw the range of Pd 0.5 over the ground's reflectivity, and over the intruder's speed."""
    with panels_written_as_png(path, 1, 2) as (left, right):
        for name, keys, colour, style in _WAYS:
            ranges = [half_range_m(keys, gamma_db) / 1000 for gamma_db in _GAMMAS_DB]
            left.plot(_GAMMAS_DB, ranges, style, color=colour, linewidth=1.3, label=name)
            if "moving_target_filter" in keys:
                ranges = [half_range_m(keys, -20.0, speed) / 1000 for speed in _SPEEDS_M_S]
                right.plot(_SPEEDS_M_S, ranges, style, color=colour, linewidth=1.3)
        left.set_xlabel("reflectivity gamma of the ground, dB")
        left.set_ylabel("range of Pd 0.5, km")
        right.set_xlabel("speed of the intruder, m/s")
        for axes in (left, right):
            axes.set_ylim(0, 10)
        draw_legend_below(left, 2)


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.make.clutter",
        description="Run scenes with clutter and write their page; the figure goes to images/.",
    )
    parser.add_argument("page", type=Path)
    target = parser.parse_args(arguments).page
    text = page(target.parent / "images")
    write_file(target, stamped(text, "python -m docs.make.clutter docs/clutter.md").encode())
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main())
