"""Table 4.4: detection ranges of the EO camera, from the literature, the thesis and ours."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from components.optical.signature import detection_range
from components.optical.silhouette import visible_area
from components.thesis.basis import calibrated, predicted
from components.thesis.made import Made, Picture
from components.thesis.plotting import BLUE, GREY, ORANGE, SKY, panels
from components.thesis.printed import printed
from components.thesis.project_files import aircraft, eo_camera
from components.thesis.row import Row

# Not printed; 9.5 km for the ascending Convair follows from it by the thesis's equations
# (errata 23), and the King Air is taken to climb alike.
CLIMB_DEG = 1.4


@dataclass(frozen=True)
class EoCase:
    """One line of Table 4.4; the Boeing 787 stands for the Convair (errata 23).

    The simulated cell is lost in the first line, and none in the others.
    """

    geometry: str
    intruder: str
    file: str
    heading_deg: float
    climb_deg: float
    lost: bool = False

    @property
    def name(self) -> str:
        """Name of its cells in `printed`."""
        geometry = self.geometry.lower().replace("ascending head-on", "ascending")
        return f"{geometry} {self.intruder.lower()}"

    @property
    def literature_km(self) -> str:
        """The flight tests' range, as printed."""
        return printed("table-4.4", f"literature {self.name}")

    @property
    def thesis_km(self) -> str | None:
        """The thesis's simulated range, as printed."""
        return None if self.lost else printed("table-4.4", self.name)


CASES = (
    EoCase("Ascending head-on", "King Air", "king_air", 180.0, CLIMB_DEG, lost=True),
    EoCase("Ascending head-on", "Convair", "boeing_787", 180.0, CLIMB_DEG),
    EoCase("Level abeam", "King Air", "king_air", 90.0, 0.0),
    EoCase("Level head-on", "King Air", "king_air", 180.0, 0.0),
    EoCase("Level head-on", "Convair", "boeing_787", 180.0, 0.0),
)
_CLIMBING = (
    "the exact projection shows the wings of an aircraft that climbs at us, where eq. 9-13 show "
    "its side (errata 9)"
)
_FOUR_ON_THREE = "Four cells, three constants set from them (P, front, climb): one is free."
_LITERATURE = "no single contrast P gives all the flight tests' ranges (errata 23)"


def make() -> Made:
    """Return the five ranges by the thesis's equations and by the exact projection."""
    camera = eo_camera()
    p = camera.p
    settings = (
        f"a = {p.static_weight:g}, threshold {p.threshold:g}, P = 1, b = {p.dynamic_weight:g}"
    )
    rows = []
    printed_rungs = [range_km(case, camera, "thesis") for case in CASES]
    exact = [range_km(case, camera, "exact") for case in CASES]
    for case, thesis_rung, ours in zip(CASES, printed_rungs, exact, strict=True):
        name = f"{case.geometry}, {case.intruder}"
        p_of = f"aircraft/{case.file}.toml:contrast"
        front = f"aircraft/{case.file}.toml:eo.front_m2"
        one_p = predicted(f"one contrast, P = 1, and Table 3.1's areas; {settings}",
                          p_of, front, "sensors/afrl_eo.toml:static_weight")  # fmt: skip
        if case.climb_deg:
            climb = f"The climb, {CLIMB_DEG}°, is not printed: it follows from the Convair's cell."
            climbing = (
                None
                if case.lost
                else calibrated("the climb, which is not printed", "eo_ranges:CLIMB_DEG", p_of)
            )
            rows += [
                Row(f"{name}, thesis's eq. 9-13", thesis_rung, "km", climb, case.thesis_km,
                    basis=climbing),
                Row(f"{name}, exact projection", ours, "km", climb, case.thesis_km, None,
                    _CLIMBING, climbing),
            ]  # fmt: skip
        else:
            king = case.file == "king_air"
            what = "P = 1 and the front of 12 m², neither printed" if king else "P = 1, not printed"
            cells = calibrated(what, p_of, front) if king else calibrated(what, p_of)
            cut = f"{_FOUR_ON_THREE} The table cuts its last digit off: 0.1 km are allowed for."
            rows.append(
                Row(f"{name}, thesis's eq. 9-13", thesis_rung, "km", cut, case.thesis_km, 0.1,
                    basis=cells)
            )  # fmt: skip
        rows.append(Row(f"{name}, against the literature", ours, "km", "",
                        case.literature_km, None, _LITERATURE, one_p))  # fmt: skip
    for case, ours in zip(CASES, exact, strict=True):
        needed = (float(case.literature_km) / ours) ** 2
        name = f"contrast P that gives the literature, {case.geometry}, {case.intruder}"
        why = "Range goes with the square root of P: ±10 % in P are ±5 %."
        rows.append(Row(name, needed, "", why))
    rows += _measured_king_air(camera)
    abeam = CASES[2]
    rate = 100.0 / (1000.0 * range_km(abeam, camera, "exact"))
    moved = range_km(abeam, camera, "exact", dynamic=rate)
    rows.append(Row("Level abeam, King Air at 100 m/s, with b = 1 s/rad", moved, "km",
                    "How little b matters: the line of sight turns at 0.016 rad/s."))  # fmt: skip

    def draw(path: Path) -> None:
        names = [f"{case.geometry.replace(' ', chr(10))}\n{case.intruder}" for case in CASES]
        place = np.arange(float(len(CASES)))
        bars: list[tuple[str, str, Any]] = [
            ("literature (flight tests)", GREY, [float(case.literature_km) for case in CASES]),
            ("thesis", SKY, [float(case.thesis_km or "nan") for case in CASES]),
            ("ours, thesis's eq. 9-13", BLUE, printed_rungs),
            ("ours, exact projection", ORANGE, exact),
        ]
        with panels(path, width_in=7.2, height_in=4.2) as (axes,):
            for number, (label, colour, values) in enumerate(bars):
                drawn = axes.bar(place + 0.2 * (number - 1.5), values, 0.19, color=colour,
                                 label=label)  # fmt: skip
                labels = ["" if math.isnan(value) else f"{value:.1f}" for value in values]
                axes.bar_label(drawn, labels, fontsize=7)
            axes.set_xticks(place, names)
            axes.set_xlabel("geometry and intruder (the thesis's cell for the first is lost)")
            axes.set_ylabel("detection range [km]")
            axes.set_ylim(0, 13)
            axes.legend(loc="upper left", ncols=2)

    data = {
        "geometry": [case.geometry for case in CASES],
        "intruder": [case.intruder for case in CASES],
        "literature_km": [case.literature_km for case in CASES],
        "thesis_km": [case.thesis_km for case in CASES],
        "ours_thesis_equations_km": printed_rungs,
        "ours_exact_km": exact,
    }
    caption = f"Average intruder detection of the EO system (Table 4.4), with {settings}."
    return Made(rows, [Picture("table_4_4", caption, draw)], {"table_4_4": data})


#: A King Air B200, level, from the nose and abeam: 396 and 273 square feet in b200.csv of
#: mit-ll/degas-surveillance-jwandrews, m².
KING_AIR_M2 = {"Level head-on": 396 * 0.3048**2, "Level abeam": 273 * 0.3048**2}


def _measured_king_air(camera: Any) -> list[Row]:
    """Return the ranges of a King Air of the measured size, with P = 1 and with more contrast."""
    rows = []
    for geometry, area_m2 in KING_AIR_M2.items():
        case = next(one for one in CASES if (one.geometry, one.intruder) == (geometry, "King Air"))
        for gain in (1.0, 1.5):
            reached = detection_range(
                area_m2,
                pixel_azimuth_rad=camera.pixel_azimuth_rad,
                pixel_elevation_rad=camera.pixel_elevation_rad,
                contrast_gain=gain,
                static_weight=camera.p.static_weight,
                threshold=camera.p.threshold,
            )
            basis = predicted(
                f"the measured area, {area_m2:.1f} m², and P = {gain:g}",
                "eo_ranges:KING_AIR_M2",
                "sensors/afrl_eo.toml:static_weight",
            )
            rows.append(
                Row(f"{geometry}, King Air of the measured size, P = {gain:g}",
                    float(reached) / 1000.0, "km", "", case.literature_km, None,
                    "P is not printed; of one aircraft it gives both ranges within 1.3 of each "
                    "other, where Table 3.1's areas differ by 1.9 and the flights not at all",
                    basis)
            )  # fmt: skip
    return rows


def range_km(case: EoCase, camera: Any, model: str, *, dynamic: float = 0.0) -> float:
    """Return the range at which a case's signature reaches the threshold, km."""
    areas = aircraft(case.file).eo.model_dump(exclude={"silhouette_table", "made_for"})
    heading, climb = math.radians(case.heading_deg), math.radians(case.climb_deg)
    area_m2 = visible_area(heading, climb, 0.0, 0.0, **areas, model=model)
    range_m = detection_range(
        area_m2,
        pixel_azimuth_rad=camera.pixel_azimuth_rad,
        pixel_elevation_rad=camera.pixel_elevation_rad,
        contrast_gain=aircraft(case.file).contrast,
        static_weight=camera.p.static_weight,
        dynamic_signature=dynamic,
        threshold=camera.p.threshold,
    )
    return float(range_m) / 1000.0
