"""DEGAS's integration test: one encounter from surveillance to metric."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow.compute as pc

import dsa_des
from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from components.geometry import line_of_sight
from docs.make.published import degas_bands, degas_sensors
from docs.make.published.rows import PublishedRow, table

TITLE = "DEGAS, from encounter to metric"
ORDER = 1
#: Well clear of aircraft that do not say where they are (DO-365): a cylinder.
WELL_CLEAR_FT = (2200.0, 450.0)

SCENE = "published/degas"

_HEAD = """
DEGAS is MIT Lincoln Laboratory's encounter simulation. Its integration test
([mit-ll/degas-core](https://github.com/mit-ll/degas-core), `code/integration_tests`, X11) flies
one encounter of an uncrewed aircraft at 97.9 kt and an intruder at 69.6 kt, both level, through
surveillance, guidance, an m-of-n filter, a pilot, and the aircraft's dynamics. We fly the same
encounter, from its few published numbers, and sample distances ten times a second, as it does:

```
dsa-des run published/degas_unmitigated
dsa-des run published/degas
```
"""

_CHOSEN = """
**Choices.** The repository has parameters of its blocks and their records; their wiring is in
Simulink files, which we did not open. Four properties were therefore read off the record of pilot
commands: a displayed alert reaches the pilot a second later; the pilot chooses when the time to
execute begins, by the least turn out and no buffer, rounded to five degrees; the next decision
comes in the tenth second after one (6 s and 3 s, and the next sample); and the command of the
turn is 3/8 per second (3°/s within 8°, its `reducedTurnAngle_deg`) of the turn left a second
before. The bank is that of its point mass. Each of these has its own key: `alerting.m_of_n`, and
`chooses`, `goes_beyond`, `track_step_deg` and `eases_deg` of `operator.stochastic`.

**Inputs and licence.** The encounter's numbers and its results, from the record of the test
(X11); the numbers of the pilot model from mit-ll/degas-pilotmodel (X11). **Not open:** nothing
that the rows need.
"""

_TRACKED = """
**Not compared: its tracked radar and tracked active surveillance.** Both state errors of tracks
by DO-365's Table 2-20, whose formulas have the range in nautical miles.
`SC228_TrackedRadarModel.m` (with `az_stddev_ft = 125*(10000 - DEGAS.nm2ft) + 250`, and likewise
for elevation and both rates) and `SC228_TrackedActiveSurveillanceModel.m` use feet instead: the
standard deviation across the line of sight comes out as {across_ft:,.0f} ft, where the table's
own bound is 250 ft at 1 nmi and 1,375 ft at 10 nmi. Until that is corrected these two are no
reference.
"""


class Flown(NamedTuple):
    """What a run came to, in feet and seconds, by samples."""

    least_ft: float
    least_at_s: float
    lost_from_s: float
    lost_s: float
    heading_deg: float


def flown(truth: Any) -> Flown:
    """Return the least horizontal distance and the loss of well clear, of a table of truth."""
    is_own = truth["target"].is_null().to_numpy()
    columns = [truth[name].to_numpy() for name in ("lat_deg", "lon_deg", "alt_m", "time_s")]
    *own, time_s = (column[is_own] for column in columns)
    *other, _ = (column[~is_own] for column in columns)
    _, elevation, range_m = line_of_sight(*own, *other)
    level_ft = range_m * np.cos(elevation) / FOOT_M
    apart_ft = np.abs(other[2] - own[2]) / FOOT_M
    nearest = int(np.argmin(level_ft))
    inside = time_s[(level_ft < WELL_CLEAR_FT[0]) & (apart_ft < WELL_CLEAR_FT[1])]
    lost = (float(inside[0]), float(inside[-1] - inside[0])) if len(inside) else (np.nan, 0.0)
    heading_deg = float(np.degrees(truth["heading_rad"].to_numpy()[is_own][-1]))
    return Flown(float(level_ft[nearest]), float(time_s[nearest]), *lost, heading_deg)


def unmitigated() -> list[PublishedRow]:
    """Return what happens if nobody gives way."""
    found = flown(dsa_des.run("published/degas_unmitigated")["truth"])
    return [
        PublishedRow("unmitigated: least separation", 684.54, found.least_ft, "ft", 1.0, digits=2),
        PublishedRow("its time", 150.1, found.least_at_s, "s", 0.1, digits=1),
        PublishedRow("well clear lost from", 141.0, found.lost_from_s, "s", 0.1, digits=1),
        PublishedRow("for", 18.0, found.lost_s, "s", 0.1, digits=1),
    ]


def mitigated(scene: Any = SCENE) -> list[PublishedRow]:
    """Return what happens with perfect surveillance."""
    result = dsa_des.run(scene)
    found = flown(result["truth"])
    alerts = result["alerts"].filter((pc.field("block") == "filter") & (pc.field("level") >= 2))
    first_s = float(alerts["time_s"][0].as_py())
    acts_s = float(result["manoeuvres"]["time_s"][0].as_py())
    return [
        PublishedRow("first alert", 78.0, first_s, "s", 1.0, digits=1),
        PublishedRow("manoeuvre", 97.0, acts_s, "s", 1.0, digits=1),
        PublishedRow("final heading", 25.0, found.heading_deg, "°", 0.001),
        PublishedRow("least separation", 3571.40, found.least_ft, "ft", 1.0, digits=2),
        PublishedRow("its time", 142.4, found.least_at_s, "s", 0.1, digits=1),
        PublishedRow("well clear lost for", 0.0, found.lost_s, "s", 0.1, digits=1),
    ]


def section(images: Path, runs: Any = None) -> str:
    """Run the encounter, and the study of its sensors or take its `runs`; return the section."""
    across_ft = 125.0 * (10_000.0 - NAUTICAL_MILE_M / FOOT_M) + 250.0
    return "\n".join(
        [
            _HEAD,
            table([*unmitigated(), *mitigated()]),
            _CHOSEN,
            degas_bands.text(),
            degas_sensors.text(images, runs),
            _TRACKED.format(across_ft=across_ft),
        ]
    )
