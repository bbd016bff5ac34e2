"""Table 2.4: the systems of the literature as scenes, and what each detects first, and where."""

from pathlib import Path
from typing import Any

import numpy as np

from components.aircraft.aspect_tables import dbsm_to_m2
from components.evidence.thesis import eo_ranges, tecvol
from components.evidence.thesis.basis import Basis, configured, predicted
from components.evidence.thesis.made import Made, Picture
from components.evidence.thesis.plotting import BLUE, GREEN, GREY, ORANGE, SKY, panels
from components.evidence.thesis.printed import printed
from components.evidence.thesis.project_files import radar, table
from components.evidence.thesis.radar_range import NAUTICAL_MILE_KM
from components.evidence.thesis.row import Row
from components.evidence.thesis.scene_run import SceneRun, run, scene
from components.optical.detection import detection_probability
from components.radar.link_budget import detection_range

#: Scene in ``configs/systems`` → the project and its sensor in Table 2.4.
SYSTEMS = {
    "dut_nlda": "DUT/NLDA: range boundary, 1D projection",
    "tecvol": "TECVOL: Swerling radar, range boundary",
    "afrl": "AFRL: EO sensors",
    "afrl_low_threshold": "AFRL: EO sensors, low threshold",
    "midas": "AFRL(2): MIDAS sensor model",
    "oasys": "Amphitech: OASys, flight test",
    "oasys_specification": "Amphitech: OASys, link budget analysis",
    "smart_uav": "SmartUAV: Swerling radar",
}
#: Files of the targets of Table 2.3.
TABLE_2_3 = (
    "obstacles/power_line",
    "obstacles/building",
    "obstacles/wooden_hill",
    "aircraft/small_aircraft",
    "aircraft/medium_aircraft",
    "aircraft/large_aircraft",
)


def _shown(target: str) -> str:
    """Return ``King Air`` for ``king_air``, ``large aircraft`` for ``large_aircraft``."""
    made_by_name = {"king_air": "King Air", "convair": "Convair", "1 m2": "1 m²"}
    return made_by_name.get(target, target.replace("_", " "))


_WITHOUT_ROW = (
    "",
    "Without a row: Table 2.1 (strengths and weaknesses in words), the CDTI's pictures (Fig. 2.1, "
    "4.15 and 4.16), the flight tests' ranges by geometry (Fig. 4.1, a plot), a block diagram and "
    "silhouettes (Fig. 4.6 and 4.7) print no number; PaRCA's range errors (40 %, about 10 % after "
    "its manoeuvres) need passive ranging, which the project does not have: its cameras measure "
    "no range.",
)
_COLOURS = (BLUE, ORANGE, GREEN, SKY, GREY, "#CC79A7")


def make() -> Made:
    """Return what each system detects first, TECVOL's errors and the RCS of Table 2.3."""
    runs = {name: run(scene(f"systems/{name}")) for name in SYSTEMS}
    first = {name: first_ranges_km(done) for name, done in runs.items()}
    statistics, errors, errors_data = tecvol.make()
    rows = [
        Row(f"{name}.toml, first detection of {target}", km, "km",
            f"{runs[name].simulation.scene.description}")
        for name, found in first.items()
        for target, km in found.items()
        if name not in ("afrl", "afrl_low_threshold")
    ]  # fmt: skip
    rows += [*_afrl(runs, first["afrl"]), *statistics, *_smart_uav()]

    def draw(path: Path) -> None:
        with panels(path, width_in=7.4, height_in=5.4) as (axes,):
            height, ticks, names = 0.0, [], []
            for name, found in reversed(first.items()):
                start = height
                for (target, km), colour in zip(found.items(), _COLOURS, strict=False):
                    axes.barh(height, km, 0.8, color=colour)
                    axes.annotate(
                        f" {_shown(target)}, {km:.2f} km", (km, height), va="center", fontsize=7
                    )
                    height += 1.0
                ticks.append(0.5 * (start + height - 1.0))
                names.append(SYSTEMS[name].replace(": ", ":\n"))
                height += 0.7
            axes.set_yticks(ticks, names, fontsize=8)
            axes.set_xlabel("range of the first detection [km]")
            axes.set_ylabel("system (configs/systems)")
            axes.set_xlim(0, 20)

    data = {
        "system": [name for name, found in first.items() for _ in found],
        "target": [target for found in first.values() for target in found],
        "first_detection_km": [km for found in first.values() for km in found.values()],
    }
    caption = "First detection of each target by the systems of Table 2.4, in one run of each."
    lines = [f"- `configs/systems/{name}.toml`: {done.simulation.scene.description}"
             for name, done in runs.items()]  # fmt: skip
    return Made(
        rows,
        [Picture("table_2_4", caption, draw), errors],
        {"table_2_4": data, "table_2_4_tecvol": errors_data},
        note="\n".join([*lines, *_WITHOUT_ROW]),
    )


def first_ranges_km(done: SceneRun) -> dict[str, float]:
    """Return at which range each target was first detected by any sensor, in order of the scene."""
    seen = done.rows("detections")
    found: dict[str, float] = {}
    for track in done.flights.targets:
        here = np.flatnonzero(seen["target"] == track.name)
        if len(here):
            at = here[np.argmin(seen["time_s"][here])]
            found[track.name] = float(seen["true_range_m"][at]) / 1000.0
    return found


def _afrl(runs: dict[str, SceneRun], first: dict[str, float]) -> list[Row]:
    """Return what section 2.4.1 says of the cameras and of the flight tests."""
    blocks = runs["afrl"].simulation.scene.blocks
    cameras = [blocks[name].parameters.model_dump() for name in ("left", "centre", "right")]
    low = runs["afrl_low_threshold"].simulation.scene.blocks["centre"].parameters.model_dump()
    high = cameras[1]
    contrast = (
        "with P = 1 and a = 0.3, which give Table 4.4, the signature reaches the threshold nearer "
        "(errata 23)"
    )
    why = "systems/afrl.toml, three cameras of a third of the field of view each."

    def of(key: str) -> Basis:
        return configured("the scene's cameras", f"systems/afrl.toml:blocks.centre.{key}")

    seen = predicted("P = 1 and a = 0.3 as for Table 4.4, and Table 3.1's areas",
                     "systems/afrl.toml:blocks.centre.static_weight",
                     "systems/afrl.toml:blocks.traffic")  # fmt: skip
    return [
        Row("AFRL, pixels in azimuth", sum(c["azimuth_pixels"] for c in cameras), "", why,
            printed("table-2.4", "pixels"), basis=of("azimuth_pixels")),
        Row("AFRL, field of view in azimuth",
            sum(c["azimuth_deg"][1] - c["azimuth_deg"][0] for c in cameras), "deg", why,
            printed("table-2.4", "field_deg"), basis=of("azimuth_deg")),
        Row("AFRL, false alarms per frame, low threshold", 100.0 * low["false_alarms_per_frame"],
            "%", "Read as per frame (assumption).", printed("table-2.4", "alarms_low"),
            basis=configured("the scene's cameras", "systems/afrl_low_threshold.toml:"
                             "blocks.centre.false_alarms_per_frame")),
        Row("AFRL, false alarms per frame, high threshold", 100.0 * high["false_alarms_per_frame"],
            "%", "Read as per frame (assumption).", printed("table-2.4", "alarms_high"),
            basis=of("false_alarms_per_frame")),
        Row("AFRL, first detection of the small aircraft", first["king_air"] / NAUTICAL_MILE_KM,
            "NM", f"Printed of the flight tests. {why}", printed("table-2.4", "first_small_nm"),
            None, contrast, seen),
        Row("AFRL, first detection of the large aircraft", first["convair"] / NAUTICAL_MILE_KM,
            "NM", f"Printed of the flight tests. {why}", printed("table-2.4", "first_large_nm"),
            None, contrast, seen),
        *_declarations(runs["afrl"]),
    ]  # fmt: skip


#: A Beech Bonanza from the nose: 10.0 m² in be35.csv of mit-ll/degas-surveillance-jwandrews.
BONANZA_M2 = 10.0


def _declarations(done: SceneRun) -> list[Row]:
    """Return where the cameras' Pd is 0.9, and that of the earlier study's Bonanza at 3 NM."""
    camera: Any = done.simulation.components["centre"]
    found = camera.detector
    weight_m2 = camera.p.static_weight / (camera.pixel_azimuth_rad * camera.pixel_elevation_rad)
    nine_of_ten = found.threshold + 1.2815515655446004 * found.noise
    unsaid = "the thesis does not say what declares; this is where nine looks of ten detect"
    rows = []
    for cell, name, area_m2 in (
        ("declared_small_nm", "small", eo_ranges.KING_AIR_M2["Level head-on"]),
        ("declared_large_nm", "large", 90.0),
    ):
        reached_km = (weight_m2 * area_m2 / nine_of_ten) ** 0.5 / 1000.0
        rows.append(
            Row(f"AFRL, declaration of the {name} aircraft: Pd 0.9", reached_km / NAUTICAL_MILE_KM,
                "NM", f"Head-on, {area_m2:.1f} m², P = 1.", printed("table-2.4", cell), None,
                unsaid,
                predicted("P = 1, and noise by 0.01 % of false alarms a frame",
                          "systems/afrl.toml:blocks.centre.static_weight",
                          "systems/afrl.toml:blocks.centre.false_alarms_per_frame"))
        )  # fmt: skip
    other = "another camera, on a helicopter, whose pixels are not printed; it saw motion, not size"
    for cell, distance_nm in (("pd_near", 2.0), ("pd_far", 3.5)):
        signature = weight_m2 * BONANZA_M2 / (1000.0 * distance_nm * NAUTICAL_MILE_KM) ** 2
        pd = detection_probability(signature, found.threshold, found.noise)
        rows.append(
            Row(f"AFRL, Pd of a Bonanza at {distance_nm:g} NM, high threshold", 100.0 * float(pd),
                "%", "Printed of an earlier study: 100 % below 3 NM, 90 % beyond.",
                printed("table-2.4", cell), None, other,
                predicted("the flight tests' camera", "systems:BONANZA_M2",
                          "systems/afrl.toml:blocks.centre.static_weight"))
        )  # fmt: skip
    return rows


def _smart_uav() -> list[Row]:
    """Return the RCS of Table 2.3 as configured, and how far each is seen."""
    sensor = radar()
    rows = []
    for file in TABLE_2_3:
        target = table(file)
        name = file.partition("/")[2]
        label = name.replace("_", " ")
        rows.append(
            Row(f"RCS of the {label}", target["rcs_dbsm"], "dBsm", "", printed("table-2.4", name),
                basis=configured(f"{file}.toml", f"{file}.toml:rcs_dbsm"))
        )  # fmt: skip
        range_m = detection_range(
            sensor.link_budget(),
            dbsm_to_m2(target["rcs_dbsm"]),
            pd=0.9,
            false_alarm_probability=sensor.false_alarm_probability,
            model=f"swerling{target['swerling']}",
        )
        rows.append(Row(f"range of Pd 0.9 for the {label}", float(range_m) / 1000.0, "km",
                        "sensors/oasys.toml stands for SmartUAV's unprinted radar; beyond 15 km "
                        "it does not look."))  # fmt: skip
    return rows
