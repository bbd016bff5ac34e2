"""A recorded encounter (``.daa``) for the page: flights only, the first aircraft is the ownship."""

from pathlib import Path

import numpy as np

from components.formats.daa_file import read_daa_samples
from components.formats.text_rows import TrafficFileError
from components.view.picture import RunPicture, TangentPlane
from dsa_des.errors import UsageError


def encounter_picture(path: Path) -> RunPicture:
    """Return the page's picture of a ``.daa`` file.

    Raises
    ------
    UsageError
        The file cannot be read.
    """
    try:
        samples = read_daa_samples(path)
    except TrafficFileError as error:
        raise UsageError(str(error)) from error
    own, *others = samples
    first, last = (float(samples[own]["time"][place]) for place in (0, -1))
    plane = TangentPlane(float(samples[own]["lat"][0]), float(samples[own]["lon"][0]))
    picture = RunPicture(path.name, {"ownship": own}, last - first, first, targets=others)
    columns = []
    for place, name in enumerate(samples):
        table = samples[name]
        east, north = plane.east_north_m(table["lat"], table["lon"], table["alt"])
        track = np.unwrap(np.arctan2(table["ve"], table["vn"]))
        common = {"time_s": table["time"] - first, "east_m": east, "north_m": north}
        if place == 0:
            picture.tables["own"] = {**common, "alt_m": table["alt"], "heading_rad": track}
            continue
        target = np.full(len(east), place - 1)
        columns.append({**common, "alt_m": table["alt"], "target": target})
    if columns:
        picture.tables["truth"] = {
            name: np.concatenate([part[name] for part in columns]) for name in columns[0]
        }
    return picture
