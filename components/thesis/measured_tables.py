"""Errors of the aircraft models against measured tables that this project cannot carry.

The tables are projected areas over aspect on a grid of 15°, in square feet: be99.csv and f16.csv of
https://github.com/mit-ll/degas-surveillance-jwandrews (MIT Lincoln Laboratory, X11 licence). The
errors below are what the comparison command gave on `MEASURED_ON`; nothing here makes them again. A
test does where the tables are, and is skipped where they are not.
"""

MEASURED_ON = "2026-11-22"
SOURCE = "mit-ll/degas-surveillance-jwandrews"
COMMAND = (
    "python -m components.thesis.silhouette_comparison --aircraft "
    "configs/aircraft/{aircraft}.toml --reference {table} --out DIR"
)

#: Aircraft file → file of its table.
TABLES = {"beech_99": "be99.csv", "f_16": "f16.csv"}

#: Aircraft file → axis → mean and maximum error of the thesis's equations 9 to 13, as a share.
ERRORS = {
    "beech_99": {
        "x": (0.126272, 0.249041),
        "y": (0.122362, 0.314963),
        "z": (0.098252, 0.159987),
    },
    "f_16": {
        "x": (0.169343, 0.378909),
        "y": (0.163740, 0.318022),
        "z": (0.269881, 0.378909),
    },
}

#: Why they differ from Table 4.3: areas of the table beside those of Table 3.1, m².
DIFFER = {
    "beech_99": "the table shows 23 m² from the nose, 32 abeam and 93 at most, Table 3.1's bodies "
    "12, 42 and 132",
    "f_16": "the table shows 13 m² from the nose, 44 abeam and 93 at most, Table 3.1's bodies "
    "7, 27 and 277",
}
