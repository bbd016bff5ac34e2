"""The true flights as a ``.daa`` file, which DAIDALUS and `traffic.daa_file` read."""

import numpy as np

from components.export.recorded import RecordedTables
from dsa_des.errors import UsageError

_HEAD = (
    "NAME, lat, lon, alt, trk, gs, vs, heading, time",
    "[], [deg], [deg], [m], [deg], [m/s], [m/s], [deg], [s]",
)


def daa_text(run: RecordedTables) -> str:
    """Return the flights instant by instant, the ownship first.

    Raises
    ------
    UsageError
        A name that such a file cannot hold.
    """
    rows: list[tuple[float, int, str]] = []
    for place, (name, flight) in enumerate(run.flights().items()):
        if any(c in name for c in ",;\t\n\r ") or not name:
            raise UsageError(f"{run.folder}: the name {name!r} holds what separates cells: rename")
        north, east = flight["velocity_north_m_s"], flight["velocity_east_m_s"]
        track_deg = np.degrees(np.arctan2(east, north)) % 360.0
        heading_deg = np.degrees(flight["heading_rad"]) % 360.0
        columns = (
            flight["lat_deg"], flight["lon_deg"], flight["alt_m"], track_deg, np.hypot(north, east),
            -flight["velocity_down_m_s"], heading_deg, flight["time_s"],
        )  # fmt: skip
        for cells in zip(*(column.tolist() for column in columns), strict=True):
            text = ", ".join([name, *(repr(cell) for cell in cells)])
            rows.append((cells[-1], place, text))
    rows.sort(key=lambda row: row[:2])
    return "\n".join([*_HEAD, *(text for _, _, text in rows)]) + "\n"
