"""Table 4.1: the aircraft of the flight tests and their RCS classes, as configured."""

from components.thesis.basis import configured
from components.thesis.made import Made
from components.thesis.printed import printed
from components.thesis.project_files import aircraft
from components.thesis.row import Row

#: Aircraft file → name and class.
TABLE_4_1 = {
    "glider": ("Glider", "small"),
    "stinson": ("Stinson", "small"),
    "long_ez": ("Long EZ", "small"),
    "extra_300": ("Extra 300", "medium"),
    "beech_duchess": ("Beech Duchess", "medium"),
    "king_air": ("King Air", "large"),
    "fa_18": ("FA-18", "large"),
}


def make() -> Made:
    """Return the RCS that the files in ``configs/aircraft`` hold."""
    rows = [
        Row(f"RCS of the {name} (class {size})", aircraft(file).rcs_dbsm, "dBsm",
            "", printed("table-4.1", file),
            basis=configured(f"aircraft/{file}.toml", f"aircraft/{file}.toml:rcs_dbsm"))
        for file, (name, size) in TABLE_4_1.items()
    ]  # fmt: skip
    data = {
        "aircraft": [name for name, _ in TABLE_4_1.values()],
        "class": [size for _, size in TABLE_4_1.values()],
        "rcs_dbsm": [row.ours for row in rows],
    }
    return Made(rows, data={"table_4_1": data})
