"""Table 4.1: the aircraft of the flight tests and their RCS classes, as configured."""

from components.evidence.thesis.made import Made
from components.evidence.thesis.project_files import aircraft
from components.evidence.thesis.row import Row

#: Aircraft file → name, class and RCS in dBsm as printed.
TABLE_4_1 = {
    "glider": ("Glider", "small", "1.76"),
    "stinson": ("Stinson", "small", "1.76"),
    "long_ez": ("Long EZ", "small", "1.76"),
    "extra_300": ("Extra 300", "medium", "3.01"),
    "beech_duchess": ("Beech Duchess", "medium", "3.01"),
    "king_air": ("King Air", "large", "6.99"),
    "fa_18": ("FA-18", "large", "6.99"),
}


def make() -> Made:
    """Return the RCS that the files in ``configs/aircraft`` hold."""
    rows = [
        Row(f"RCS of the {name} (class {size})", aircraft(file).rcs_dbsm, "dBsm",
            f"aircraft/{file}.toml, as printed; 0.005 dB are one last digit.", printed)
        for file, (name, size, printed) in TABLE_4_1.items()
    ]  # fmt: skip
    data = {
        "aircraft": [name for name, _, _ in TABLE_4_1.values()],
        "class": [size for _, size, _ in TABLE_4_1.values()],
        "rcs_dbsm": [row.ours for row in rows],
    }
    return Made(rows, data={"table_4_1": data})
