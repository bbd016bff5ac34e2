"""A run's folder in the formats and objects of other programs."""

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from components.export.stone_soup_run import StoneSoupRun
    from dsa_des.record.run_folder import Run


def stone_soup(
    run: "Run | str | os.PathLike[str]",
    *,
    origin: tuple[float, float, float] | None = None,
    range_rates: bool = False,
    platform: str | None = None,
) -> "StoneSoupRun":
    """Return a recorded run as Stone Soup's objects: detections, the ownship's poses and truth.

    Parameters
    ----------
    run : path of a run's folder, or what `dsa_des.run` returns
    origin : tuple, optional
        Latitude and longitude (deg) and height above the ellipsoid (m) of the frame, in which x is
        east, y north and z up; by default that of the run's tracks, or where the ownship was first.
    range_rates : bool
        Whether measured range rates count; leave it where those of a radar fold (a low pulse rate).
    platform : str, optional
        Of several platforms, the one that is the ownship here; by default the scene's.

    Returns
    -------
    StoneSoupRun
        ``detector`` for a tracker, ``platform``, ``truth``, ``ownship`` and ``origin``.

    Raises
    ------
    ImportError
        The extra ``stonesoup`` is not installed.
    UsageError
        It is no run's folder, or one whose detections have no errors or poses.
    """
    from components.stone_soup.library import require_stone_soup

    require_stone_soup("components.export.stone_soup")
    from components.display.recorded_run import tables_of
    from components.export.stone_soup_run import recorded_run

    tables = tables_of(run)
    if platform is not None or tables.platform_by_block:
        tables = tables.seen_from(platform or tables.own_name)
    return recorded_run(tables, origin, range_rates)
