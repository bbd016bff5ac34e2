"""Fig. 3.11: which share of the front and of the back sphere shows at which heading."""

from pathlib import Path

import numpy as np

from components.optical.silhouette_exact import front_and_back_area
from components.thesis.basis import configured
from components.thesis.made import Made, Picture
from components.thesis.plotting import BLUE, GREEN, ORANGE, panels
from components.thesis.printed import printed
from components.thesis.row import Row

# §3.5.3: "the parameters a and b are set to 1 and 1.5 for the plot and represent the size of the
# back and front sphere respectively".
BACK_M2, FRONT_M2 = 1.0, 1.5


def make() -> Made:
    """Return the contributions of eq. 20 and their sum, eq. 21."""
    heading_deg = np.arange(0.0, 361.0)
    cosine = np.cos(np.radians(heading_deg))
    none = np.zeros_like(cosine)
    back = front_and_back_area(cosine, none, none + BACK_M2)
    front = front_and_back_area(cosine, none + FRONT_M2, none)
    together = front_and_back_area(cosine, none + FRONT_M2, none + BACK_M2)
    why = (
        "Eq. 21 with a the back and b the front; heading 0 flies away and shows the back "
        "(errata 12)."
    )
    rows = [
        Row("area shown at relative heading 0° (the back)", together[0], "m²", why,
            printed("fig-3.11", "back"),
            basis=configured("the back sphere's area, a", "front_and_back:BACK_M2")),
        Row("area shown at relative heading 180° (the front)", together[180], "m²", why,
            printed("fig-3.11", "front"),
            basis=configured("the front sphere's area, b", "front_and_back:FRONT_M2")),
        Row("area shown abeam, half of each", together[90], "m²", why),
        Row("largest difference of the sum from back plus front share",
            float(np.abs(together - back - front).max()), "m²", "Eq. 20 and eq. 21 are the same."),
    ]  # fmt: skip

    def draw(path: Path) -> None:
        with panels(path) as (axes,):
            axes.plot(heading_deg, back, "--", color=BLUE, label="back sphere, a = 1 m²")
            axes.plot(heading_deg, front, ":", color=ORANGE, label="front sphere, b = 1.5 m²")
            axes.plot(heading_deg, together, color=GREEN, label="sum (eq. 21)")
            axes.set_xlabel("relative heading ψ_rel [deg]: 0 flies away, 180 comes towards us")
            axes.set_ylabel("contribution to the signature [m²]")
            axes.set(xlim=(0, 360), ylim=(0, 1.8), xticks=range(0, 361, 45))
            axes.legend(loc="upper center", ncols=3)

    data = {"heading_deg": heading_deg, "back_m2": back, "front_m2": front, "sum_m2": together}
    caption = "Shape of the contribution of the front and back sphere to the static signature."
    return Made(rows, [Picture("fig_3_11", caption, draw)], {"fig_3_11": data})
