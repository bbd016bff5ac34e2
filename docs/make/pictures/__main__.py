"""``python -m docs.make.pictures docs/pictures.md``: make the page and its figures."""

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from components.thesis.drawing import GREY
from docs.make.pictures.bound import bound_table
from docs.make.pictures.flow import flow_table
from docs.make.pictures.looks import (
    CASES,
    HALF,
    NOISE,
    SEEDS,
    calibration,
    factor_of,
    half_range_m,
    looks,
    quiet,
    scene_file,
)
from docs.make.pictures.matched import range_table, size_table
from docs.make.stamp import stamped
from dsa_des.block.mark import BLUE, PINK
from dsa_des.files.output_file import write_file
from dsa_des.record.drawing import draw_to_png
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.terminal.interruption import exit_plainly_on_signal

FIGURE = "pictures.png"
SEEN = "picture_patches.png"
#: That of the shipped cameras, by their threshold of 1, for a second look at the factor.
SHIPPED_NOISE = 0.25


_FLOWN = """```python
import numpy as np
from components.geometry import body_angles, line_of_sight_ned, ned_to_body
from components.optical.picture import Pinhole

frame_s = np.array([0.0, 0.11, 0.19])
own = np.array([-33.9, 18.4, 900.0])[:, np.newaxis] + np.zeros(3)  # deg, deg, m
attitude = np.radians([[217.0, 217.2, 217.5], [2.0, 2.0, 2.1], [-20.0, -20.5, -21.0]])
logged_s = np.array([-0.02, 0.23])  # the intruder's own time stamps
logged = np.array([[-33.91, -33.9101], [18.391, 18.3909], [930.0, 930.5]])
intruder = [np.interp(frame_s, logged_s, values) for values in logged]
mounting = np.radians([7.0, -3.0, -12.0])

body = ned_to_body(*line_of_sight_ned(*own, *intruder), *attitude)
camera = Pinhole.calibrated((1180.0, 1175.0), (1010.0, 540.0), columns=2048, rows=1024)
column, row = camera.pixel(*body_angles(*ned_to_body(*body, *mounting)))
```"""

_HEAD = """# Image-based camera

What does a camera's detector make of a rendered picture? With `pip install 'dsa-des[image]'`:

> `dsa-des run optical/pictures`

![Patches as the camera saw them](images/{seen})

`optical.image` renders the image of an electro-optical camera around every target, and searches
it for the target. It takes the keys of `optical.eo`. Each look is two frames: the target's
outline with exact coverage of pixels, its smear over `exposure_s`, the blur, a background of
`texture_contrast` that is fixed in NED, and noise. OpenCV filters of several sizes find the spot,
whose position is reported; detections have `column_px`, `row_px`, and the flow of the target
between the frames in pixels, `flow_column_px` and `flow_row_px`, with the turn of the line of
sight that follows from it, `flow_rate_rad_s`. The operator's display shows the patch.

**Pixels of a flown run.** The camera is a pinhole model, so `true_column_px` and `true_row_px`
give a target's position in a frame of any field of view, size and mounting. A file of flights
instead of the traffic, a shipped one or your own, gives the path in pixels:

```
dsa-des run optical/pictures --swap traffic=traffic.daa_file --set \
blocks.traffic.file=encounters/crossing.daa
```

For a calibrated camera, frames with their own time stamps, and undetected targets, the same from
Python, with a pose of both aircraft for each frame. The mounting turns the aircraft's axes (nose,
right wing, floor) into the camera's as azimuth, elevation and roll, in this order; the focal
length and the principal point are in pixels from the upper left corner:

{flown}

**Accuracy.** The rendered area is that of the union of the bodies within 0.3 %. At a noise of
0.02 of the target's contrast the flow of targets from 4 pixels agrees with the turning line of
sight within 0.1 pixel ([below](#accuracy-of-the-flow)). A spot of fewer than 3 pixels has a
position and no flow.

**Limitations.** Only targets are rendered: false alarms are drawn as those of `optical.eo`, and
clutter makes none. A search for a target that is too faint finds noise instead: through 4 filters
and 52 pixels above 3 deviations 5 times as often as in 12 independent positions, the number that
`optical.eo` counts, as peaks of a smooth field are (Adler, 1981). The background has no depth.

## Errors of the signature model

`python -m docs.make.pictures`; of one scene, `dsa-des cost optical/pictures`

The thesis simulates optical flow by a signature and recommends (5.3.1) to compare it with an
algorithm that works on images. The target is stationary and the camera approaches by the same
share of the range in each case: the range is where half of the looks detect, at 0.0001 false
alarms a frame and a pixel's noise of {noise:g}. Both cameras have the same noise and threshold.

| | picture, km | signature, km | signature / picture |
|---|---|---|---|
"""

_FLOW = """
## Accuracy of the flow

`python -m docs.make.pictures`: six seeds of four targets, from 3 to 150 pixels, straight on and
then banked at heading 217° in the southern hemisphere, two frames 0.04 s apart; the distance of
the flow from the displacement of the true pixel. Noise of a pixel and clutter are in the target's
contrast. `flow_deviation_px` is the standard deviation of each flow along the least observable
axis. The last columns are the root mean square of the error over that deviation, 1 if it is
consistent along either axis, and the share of flows within 2.45 of it, 95 % or more if it covers.
If the stated deviation is below 0.04, 95 % of flows are within 0.1 pixel. No flow is reported if
the spot is not found again, or the deviation is above 0.25.

**Bound by noise.** `python -m docs.make.pictures.bound`: no unbiased estimate from two frames is
better than the Cramér-Rao bound 2 σ² (Σ ∇s ∇sᵀ)⁻¹ of the shift of a spot s in white noise of
deviation σ in each. At a noise of 0.05 (two seeds) 95 % of flows are within

{bound}
So 0.1 pixel at that noise is beyond any method for targets below 40 pixels; the bound
grows with the noise, and is 0.067 for the smallest at 0.02.

"""

_WHY = """
![Detection range by both, and how far the stated Pd holds](images/{figure})

Means of six seeds, with their 95 % intervals; "never" if half of the looks never detect, with one
of the seeds at least. On a calm background the signature detects 11 to 21 % farther, large and
faint targets no more than others (for the reason see the next sections). From abeam both detect
from the start of the run on, 4.4 km away. The signature models neither smear nor clutter.

**Cost.** A look of a picture costs {image_us:.0f} µs of CPU time on one core here, and one of the
signature {signature_us:.2f} µs.

## Against the matched filter

`python -m docs.make.pictures.matched`

No filter gives a target in white noise a higher SNR than the one matched to it. A filter that fits
a target of N pixels lets in the noise of the pixels of its blur, s = 4π (b² + 1/12) for a blur of
b pixels, and of its own: the signature cameras take sqrt(s + N) of a pixel's noise, in the unit of
the threshold a share sqrt(s / (s + N)) of the signature. The SNR of discs that have 8 behind their
matched filter, worked out from the spectra of disc, blur and pixel; of the rendering camera the
mean of its looks, of the signature cameras that of the Pd they state. The last column is what the
noise of a point alone would give:

{sizes}
Range, km, at which half of the looks detect a sphere of 9 m², in pixels of 0.01°, by the noise of
a pixel in its contrast:

{ranges}
A long, thin target stands out less than a disc of its area: a rectangle of 1 to 4 by 14
% at 10 pixels. With a threshold of 1 and no other key, half of the looks detect at 0.82 of the
range at which eq. 18 gives 1 to a target of contrast 1, for the thesis counts no noise
(`noise_equivalent_contrast = 0`).

## Calibration of the stated probability

Method: looks of the signature model at a target and of pictures of it, at the same instants of
all cases without clutter and smear, in bins of the Pd that the signature states (the table
`looks`). If calibrated, the stated share is detected. {factor:.2f} times the signature states the
Pd of pictures (the median over bins from 0.05 to 0.999), and {shipped:.2f} times at a noise of
{shipped_noise:g}, that of a threshold of 1: a `contrast` reduced by this factor makes
`optical.eo` a substitute for this camera without clutter, at its field of view. In the middle of
a plane picture of 80° by 40° a target covers 0.80 times as many pixels, and filters of four sizes
reach 0.92 times the SNR of the table above.

| stated Pd | detected in pictures | standard error | looks |
|---|---|---|---|
"""


def _told(values: np.ndarray) -> str:
    """Return a mean with its interval, or why there is none."""
    if np.isinf(values).any():
        return "from the start on"
    if not np.isfinite(values).all():
        return "never"
    return f"{values.mean():.2f} ± {HALF * values.std(ddof=1):.2f}"


def _page(folder: Path) -> str:
    text = _HEAD.format(seen=SEEN, noise=NOISE, flown=_FLOWN)
    rows: list[Any]
    rows, pairs, cost_s, looked = (
        [],
        [],
        {"image": 0.0, "signature": 0.0},
        dict.fromkeys(("image", "signature"), 0),
    )
    for name, case in CASES:
        ranges: dict[str, list[float]] = {"image": [], "signature": []}
        for seed in SEEDS:
            seen = {}
            for kind in ("image", "signature"):
                started = time.process_time()
                seen[kind] = looks(kind, **case, seed=seed)
                cost_s[kind] += time.process_time() - started
                looked[kind] += len(seen[kind]["scan"])
                ranges[kind].append(half_range_m(seen[kind]) / 1000.0)
            if not {"texture", "exposure_s"} & case.keys():
                pairs.append((seen["image"], seen["signature"]))
        by = [np.array(ranges[kind]) for kind in ("image", "signature")]
        means = [float(one.mean()) for one in by]  # what is not finite is not drawn
        rows.append((name, *(mean if math.isfinite(mean) else math.nan for mean in means)))
        told = [_told(one) for one in by]
        told.append(_told(by[1] / by[0]) if np.isfinite(by).all() else "")
        text += f"| {name} | {' | '.join(told)} |\n"
    bins = calibration(pairs)
    plain = [case for name, case in CASES if not {"texture", "exposure_s"} & case.keys()]
    far = [
        (looks("image", **keys), looks("signature", **keys))
        for case in plain
        for keys in ({**case, "noise": SHIPPED_NOISE, "seed": seed} for seed in SEEDS[:2])
    ]
    text += _WHY.format(
        figure=FIGURE,
        image_us=1e6 * cost_s["image"] / looked["image"],
        factor=factor_of(bins),
        shipped=factor_of(calibration(far), SHIPPED_NOISE),
        shipped_noise=SHIPPED_NOISE,
        sizes=size_table(),
        ranges=range_table(),
        signature_us=1e6 * cost_s["signature"] / looked["signature"],
    )
    for stated, share, error, count in bins:
        text += f"| {stated:.3f} | {share:.3f} | {error:.3f} | {count} |\n"
    text += _FLOW.format(bound=bound_table()) + flow_table()
    _draw(folder / FIGURE, rows, bins)
    _draw_patches(folder / SEEN)
    return text


def _draw(path: Path, rows: list[Any], bins: list[Any]) -> None:
    with draw_to_png(9.5, 4.2, path) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        place = np.arange(len(rows))
        left.barh(place - 0.2, [row[1] for row in rows], 0.38, color=BLUE, label="picture")
        left.barh(place + 0.2, [row[2] for row in rows], 0.38, color=PINK, label="signature")
        left.set_yticks(place, [row[0] for row in rows])
        left.invert_yaxis()
        left.set_xlabel("range of 50 % detection (km)")
        left.legend(frameon=False)
        right.plot([0, 1], [0, 1], color=GREY, linewidth=1)
        stated, share, error, _ = zip(*bins, strict=True)
        right.errorbar(stated, share, yerr=error, color=BLUE, marker="o", markersize=4)
        right.set_xlabel("Pd stated by the signature")
        right.set_ylabel("share detected in pictures")
        figure.tight_layout()


def _draw_patches(path: Path) -> None:
    """Draw the last patches of the shipped scene, each target from far to near."""
    simulation = Simulation(load_scene(scene_file(), sets=quiet()))
    simulation.run()
    camera: Any = simulation.components["eo"]
    with draw_to_png(9.5, 3.6, path) as figure:
        for row, target in enumerate(sorted({key[0] for key in camera.patches})):
            ticks = [tick for one, tick in camera.patches if one == target]
            for column, number in enumerate(np.linspace(0, len(ticks) - 1, 6).astype(int)):
                axes = figure.add_subplot(2, 6, 6 * row + column + 1)
                patch = camera.patches[target, ticks[number]]
                axes.imshow(patch, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
                axes.set_title(f"{ticks[number] / simulation.ticks_per_s:.1f} s", fontsize=8)
                axes.set_axis_off()
        figure.tight_layout()


def main(argv: list[str]) -> int:
    """Write the page and its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path)
    page = parser.parse_args(argv).page
    text = _page(page.parent / "images")
    write_file(page, stamped(text, "python -m docs.make.pictures docs/pictures.md").encode())
    return 0


if __name__ == "__main__":
    with exit_plainly_on_signal():
        sys.exit(main(sys.argv[1:]))
