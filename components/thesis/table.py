"""The results of the thesis: each item, what makes it, and what it prints, allows for and errs in.

Nothing is computed from a printed number but where a row says so: change one, and the result
beside it must stay.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial

from components.thesis import (
    cameras,
    flight_tests,
    maps,
    overtaking,
    radar,
    silhouettes,
    systems,
)
from components.thesis.rows import Cells, Made, Printed
from dsa_des.errors import UsageError, did_you_mean


@dataclass(frozen=True)
class Item:
    """One result of the thesis, with what its caption says and the numbers that it prints."""

    name: str
    title: str
    function: Callable[[Cells], Made]
    printed: dict[str, Printed] = field(default_factory=dict)

    def make(self) -> Made:
        """Compute the item and return its rows, figures and data."""
        return self.function(self.printed)


def _printed_numbers(
    numbers: dict[str, str], tolerance: float | None = None, because: str = ""
) -> dict[str, Printed]:
    """Return printed numbers by name that share one tolerance and one reason."""
    return {name: Printed(text, tolerance, because) for name, text in numbers.items()}


_CONTRADICT = "the flight tests saw farther than the specification (errata 6)"
_LARGE = (
    "no one bandwidth gives all three printed values: small and medium agree with each other, "
    "the large class would need 10.45 km or 5.8 dBsm"
)
_NO_IMAGES = (
    "its FlightGear images are not to be had: our reference is the exact union of the model's "
    "own bodies"
)
_SHARE = "the range goes with the square root of the area, whatever the range (errata 26)"
_NEARER = "1 to 3 m² mean 1.8 to 3.1 km, nearer than any detection of Table 4.4 (errata 26)"
_LITERATURE = "no single contrast P gives all the flight tests' ranges (errata 23)"
_QUICK = (
    "NumPy computes look-ahead windows of scans at once on a newer processor; the thesis ran "
    "Matlab at 2.1 GHz, one target and step at a time"
)
_THRESHOLD = (
    "with P = 1 and a = 0.3, which give Table 4.4, the signature reaches the threshold nearer "
    "(errata 23)"
)
_DECLARES = "the thesis does not say what declares; this is where nine looks of ten detect"
_OTHER_CAMERA = (
    "another camera, on a helicopter, whose pixels are not printed; it saw motion, not size"
)

_MANOEUVRE = "neither the manoeuvre of the flight tests nor what its errors are of is printed"

# §4.1.3; "off by" in §5.1.3.
_FLIGHTS = {
    "pd_small": Printed("0.9114"),
    "pd_medium": Printed("0.9170"),
    "pd_large": Printed("0.8668", because=_LARGE),
    "off_small": Printed("1.1"),
    "off_medium": Printed("1.7"),
    "off_large": Printed("3.3", because=_LARGE),
    "range_large": Printed("9.75", because=_LARGE),
    "rcs_large": Printed("6.99", because=_LARGE),
}

ITEMS = (
    # §3.5.3: "the parameters a and b are set to 1 and 1.5 for the plot".
    Item("fig-3.11", "Front and back sphere over relative heading",
    silhouettes.front_and_back_contributions,
         {"back": Printed("1"), "front": Printed("1.5")}),
    Item("fig-4.2", "Pd of Swerling I and V over SNR, with the truncated table",
         radar.pd_over_snr),
    # "5 m² ... is detected at exactly 3.5 sm, that is 6.48 km"; Table 2.2: 5.6 km, P_D min. 0.9.
    Item("sec-4.1.1", "Range at which OASys detects 5 m²", radar.specified_range,
         {"range_km": Printed("6.48", because="6.48 km are 3.5 nautical miles (errata 7)"),
          "specified_km": Printed("5.6", because=_CONTRADICT),
          "pd": Printed("0.9", 0.005, _CONTRADICT)}),
    Item("fig-4.3", "SNR and Pd over range, small target (1.76 dBsm)",
         partial(radar.snr_and_pd_over_range, "small", "fig_4_3", _FLIGHTS["pd_small"])),
    Item("fig-4.4", "SNR and Pd over range, medium target (3.01 dBsm)",
         partial(radar.snr_and_pd_over_range, "medium", "fig_4_4", _FLIGHTS["pd_medium"])),
    Item("fig-4.5", "SNR and Pd over range, large target (6.99 dBsm)",
         partial(radar.snr_and_pd_over_range, "large", "fig_4_5", _FLIGHTS["pd_large"])),
    Item("sec-4.1.3", "Pd at the average detection ranges of the flight tests",
         flight_tests.pd_at_averages, _FLIGHTS),
    Item("table-4.1", "RCS classes of the flight tests' aircraft", flight_tests.rcs_classes,
         _printed_numbers({"glider": "1.76", "stinson": "1.76", "long_ez": "1.76",
         "extra_300": "3.01",
                    "beech_duchess": "3.01", "king_air": "6.99", "fa_18": "6.99"})),
    # Averages, §4.1.3.
    Item("table-4.2", "Detection ranges of the flight tests", flight_tests.detection_ranges,
         _printed_numbers({"small": "6.91", "medium": "7.31", "large": "9.75"})),
    Item("fig-4.8", "Signature of the Beech 99 over rotation",
         partial(silhouettes.signatures_over_rotations, "beech_99", "fig_4_8")),
    Item("fig-4.9", "Signature of the F-16 over rotation",
         partial(silhouettes.signatures_over_rotations, "f_16", "fig_4_9")),
    Item("fig-4.10", "Signature of the Boeing 787 over rotation",
         partial(silhouettes.signatures_over_rotations, "boeing_787", "fig_4_10")),
    # Mean and maximum errors over half turns, per cent.
    Item("table-4.3", "Mean and maximum errors of the aircraft models",
    silhouettes.silhouette_errors,
         {**_printed_numbers({
             "beech_99 x mean": "3.5", "beech_99 x maximum": "10",
             "beech_99 y mean": "11.5", "beech_99 y maximum": "18.8",
             "beech_99 z mean": "6.2", "beech_99 z maximum": "12",
             "f_16 x mean": "2.2", "f_16 x maximum": "4.9",
             "f_16 y mean": "9.2", "f_16 y maximum": "22.2",
             "f_16 z mean": "5.9", "f_16 z maximum": "16.3",
             "boeing_787 x mean": "1.3", "boeing_787 x maximum": "3.4",
             "boeing_787 y mean": "7.6", "boeing_787 y maximum": "14.2",
             "boeing_787 z mean": "2.1",
         }, because=_NO_IMAGES),
          "boeing_787 z maximum":
              Printed("82", because=f"82 is misprinted for 8.2 (errata 22), and {_NO_IMAGES}")}),
    # §4.2.1, "approximately 600 meters", "between 1 and 3", "between 6% and 20%".
    Item("eq-34", "From an error in area to one in detection range", cameras.area_error,
         {"error_m": Printed("600", 50.0,
                             "it is 600 m at a detection range of 6.29 km only (errata 26)"),
          **_printed_numbers({"low_share": "6", "high_share": "20"}, because=_SHARE),
          **_printed_numbers({"low": "1", "high": "3"}, because=_NEARER)}),
    # Simulation and literature; the first simulated cell is lost.
    Item("table-4.4", "Detection ranges of the EO system", cameras.eo_ranges,
         {**_printed_numbers({"ascending convair": "9.5", "level abeam king air": "6.2",
                    "level head-on king air": "3.3", "level head-on convair": "9.1"}),
          **_printed_numbers({"literature ascending king air": "4.8",
          "literature ascending convair": "5.4",
                    "literature level abeam king air": "6.7",
                    "literature level head-on king air": "6.7",
                    "literature level head-on convair": "7.7"}, because=_LITERATURE)}),
    Item("fig-4.11", "IR detection range over heading, first parameters", cameras.ir_ranges),
    # Table 4.6, square metres; the fighter's front and side are lost.
    Item("fig-4.13", "IR detection range over heading, refined parameters",
         cameras.ir_ranges_refined,
         _printed_numbers({
             "general_aviation front": "4.6", "general_aviation back": "4.6",
             "general_aviation side": "6", "general_aviation horizontal": "35.52",
             "small_fighter back": "14", "small_fighter horizontal": "37.16",
             "commercial_transport front": "32.5", "commercial_transport back": "65",
             "commercial_transport side": "110", "commercial_transport horizontal": "353",
         })),
    # §4.4: 5100 m.
    Item("fig-4.14", "Errors of the fused output of an overtaking intruder", overtaking.overtaking,
         {"joins_km": Printed("5.1", 0.15)}),
    # Half widths, Tables 2.2, 2.5 and 2.6.
    Item("fig-4.17", "Fields of view of the three sensors", maps.fields_of_view,
         _printed_numbers({"radar": "110", "eo": "110", "ir": "50"}, maps.STEP_DEG)),
    Item("fig-4.18", "Radar Pd decreasing with range", maps.detections_over_range),
    # Table 2.2, and the title of the figure.
    Item("fig-4.19", "Angular resolution of the radar", maps.angular_resolution,
         _printed_numbers({"fine_deg": "1", "coarse_deg": "2.5"}, 1e-6)),
    Item("fig-4.20", "One intruder through two fields of view", maps.two_fields_of_view),
    # §4.5 and §5.1.3.
    Item("fig-4.21", "Influence of the scan rate, and the timed scene", maps.scan_rate,
         {**_printed_numbers({"steps": "1800", "intruders": "4"}, 0.0),
          **_printed_numbers({"wall_s": "3", "wall_later_s": "3.5"}, because=_QUICK)}),
    # "only half of the IR detections are fused".
    Item("fig-4.22", "Unsynchronised scans of radar and IR", maps.unsynchronised,
         {"share": Printed("0.5", 0.0)}),
    # Tables 2.3 and 2.4, §2.3 and §2.4.1.
    Item("table-2.4", "The systems of the literature", systems.systems,
         {**_printed_numbers({"pixels": "6144", "field_deg": "220", "alarms_low": "0.045",
                    "alarms_high": "0.01"}),
          **_printed_numbers({"first_small_nm": "5.5", "first_large_nm": "7.4"},
          because=_THRESHOLD),
          **_printed_numbers({"declared_small_nm": "3.9", "declared_large_nm": "4.9"},
          because=_DECLARES),
          **_printed_numbers({"pd_near": "100", "pd_far": "90"}, because=_OTHER_CAMERA),
          **_printed_numbers({"parca_before": "40", "parca_after": "10"}, because=_MANOEUVRE),
          "runs": Printed("100", 0.0), "eo_km": Printed("3", 0.075),
          **_printed_numbers({"power_line": "-20", "building": "15", "wooden_hill": "20",
                    "small_aircraft": "1.76", "medium_aircraft": "3.01",
                    "large_aircraft": "6.99"})}),
)  # fmt: skip

#: Numbers of the thesis that an item covers beside its own.
_ALSO = {("eq", "33"): "eq-34", ("eq", "33.34"): "eq-34"}
_KINDS = {"figure": "fig", "tab": "table", "section": "sec", "§": "sec", "equation": "eq"}


def select_items(names: Iterable[str]) -> list[Item]:
    """Return the items of these names, in the thesis's order; all of them if none is named.

    ``fig-4.14``, ``Fig. 4.14``, ``figure_4_14`` and ``4.14`` (where only one item has the number)
    are the same item. Every name that is unknown is said, with the nearest that exists.
    """
    wanted: set[str] = set()
    problems = []
    for name in names:
        result = _matching_item_names(name)
        if len(result) == 1:
            wanted.add(result[0])
        elif result:
            problems.append(f"ITEM {name!r}: there are several; say {' or '.join(result)}")
        else:
            hint = did_you_mean(name.lower(), [item.name for item in ITEMS])
            problems.append(f"ITEM {name!r}: there is no such item{hint}")
    if problems:
        raise UsageError(problems[0], *(f"  {problem}" for problem in problems[1:]))
    return [item for item in ITEMS if not wanted or item.name in wanted]


def _matching_item_names(name: str) -> list[str]:
    """Return the names of all items that a name given by the user may mean."""
    kind, number = _kind_and_number(name)
    if (kind, number) in _ALSO:
        return [_ALSO[kind, number]]
    parts = {item.name: _kind_and_number(item.name) for item in ITEMS}
    return [full for full, (k, n) in parts.items() if n == number and kind in ("", k)]


def _kind_and_number(name: str) -> tuple[str, str]:
    """Return kind and number of an item's name in any spelling, such as fig and 4.14."""
    match = re.fullmatch(r"([a-z§]*)[\s._-]*(\d+(?:[._-]\d+)*)", name.strip().lower())
    if match is None:
        return "", name
    kind, number = match.groups()
    return _KINDS.get(kind, kind), re.sub("[_-]", ".", number)
