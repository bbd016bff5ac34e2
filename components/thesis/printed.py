"""Every number of the thesis that a row is compared with, as it is printed.

A decimal point stands for the thesis's comma. Nothing is computed from these numbers but where a
row says so: change one, and the result beside it must stay.
"""

#: Item → name → number.
PRINTED: dict[str, dict[str, str]] = {
    # §3.5.3: "the parameters a and b are set to 1 and 1.5 for the plot".
    "fig-3.11": {"back": "1", "front": "1.5"},
    # "5 m² ... is detected at exactly 3.5 sm, that is 6.48 km"; Table 2.2: 5.6 km, P_D min. 0.9.
    "sec-4.1.1": {"range_km": "6.48", "specified_km": "5.6", "pd": "0.9"},
    # §4.1.3; "off by" in §5.1.3.
    "sec-4.1.3": {
        "pd_small": "0.9114",
        "pd_medium": "0.9170",
        "pd_large": "0.8668",
        "off_small": "1.1",
        "off_medium": "1.7",
        "off_large": "3.3",
        "range_large": "9.75",
        "rcs_large": "6.99",
    },
    "table-4.1": {
        "glider": "1.76",
        "stinson": "1.76",
        "long_ez": "1.76",
        "extra_300": "3.01",
        "beech_duchess": "3.01",
        "king_air": "6.99",
        "fa_18": "6.99",
    },
    # Averages, §4.1.3.
    "table-4.2": {"small": "6.91", "medium": "7.31", "large": "9.75"},
    # Mean and maximum errors over half turns, per cent.
    "table-4.3": {
        "beech_99 x mean": "3.5",
        "beech_99 x maximum": "10",
        "beech_99 y mean": "11.5",
        "beech_99 y maximum": "18.8",
        "beech_99 z mean": "6.2",
        "beech_99 z maximum": "12",
        "f_16 x mean": "2.2",
        "f_16 x maximum": "4.9",
        "f_16 y mean": "9.2",
        "f_16 y maximum": "22.2",
        "f_16 z mean": "5.9",
        "f_16 z maximum": "16.3",
        "boeing_787 x mean": "1.3",
        "boeing_787 x maximum": "3.4",
        "boeing_787 y mean": "7.6",
        "boeing_787 y maximum": "14.2",
        "boeing_787 z mean": "2.1",
        "boeing_787 z maximum": "82",  # for 8.2, errata 22
    },
    # §4.2.1, "approximately 600 meters", "between 1 and 3", "between 6% and 20%".
    "eq-34": {"error_m": "600", "low_share": "6", "high_share": "20", "low": "1", "high": "3"},
    # Simulation and literature; the first simulated cell is lost.
    "table-4.4": {
        "ascending convair": "9.5",
        "level abeam king air": "6.2",
        "level head-on king air": "3.3",
        "level head-on convair": "9.1",
        "literature ascending king air": "4.8",
        "literature ascending convair": "5.4",
        "literature level abeam king air": "6.7",
        "literature level head-on king air": "6.7",
        "literature level head-on convair": "7.7",
    },
    # Table 4.6, square metres; the fighter's front and side are lost.
    "fig-4.13": {
        "general_aviation front": "4.6",
        "general_aviation back": "4.6",
        "general_aviation side": "6",
        "general_aviation horizontal": "35.52",
        "small_fighter back": "14",
        "small_fighter horizontal": "37.16",
        "commercial_transport front": "32.5",
        "commercial_transport back": "65",
        "commercial_transport side": "110",
        "commercial_transport horizontal": "353",
    },
    # §4.4: 5100 m.
    "fig-4.14": {"joins_km": "5.1"},
    # Half widths, Tables 2.2, 2.5 and 2.6.
    "fig-4.17": {"radar": "110", "eo": "110", "ir": "50"},
    # Table 2.2, and the title of the figure.
    "fig-4.19": {"fine_deg": "1", "coarse_deg": "2.5"},
    # §4.5 and §5.1.3.
    "fig-4.21": {"steps": "1800", "intruders": "4", "wall_s": "3", "wall_later_s": "3.5"},
    # "only half of the IR detections are fused".
    "fig-4.22": {"share": "0.5"},
    # Tables 2.3 and 2.4, §2.3 and §2.4.1.
    "table-2.4": {
        "pixels": "6144",
        "field_deg": "220",
        "alarms_low": "0.045",
        "alarms_high": "0.01",
        "first_small_nm": "5.5",
        "first_large_nm": "7.4",
        "declared_small_nm": "3.9",
        "declared_large_nm": "4.9",
        "pd_near": "100",
        "pd_far": "90",
        "runs": "100",
        "eo_km": "3",
        "power_line": "-20",
        "building": "15",
        "wooden_hill": "20",
        "small_aircraft": "1.76",
        "medium_aircraft": "3.01",
        "large_aircraft": "6.99",
    },
}


def printed(item: str, name: str) -> str:
    """Return one number as the thesis prints it."""
    return PRINTED[item][name]
