"""Recorded flights as tracks in a plane: of encounters that were flown."""

from pathlib import Path

import numpy as np

from components.formats.recorded.known_kinds import recording_of_file
from components.formats.set_file import EncounterSetError
from components.formats.text_rows import TrafficFileError
from components.formats.track_files import Tracks
from components.geometry import line_of_sight_ned


def recorded_tracks(path: Path, at: tuple[float, float] | None = None) -> Tracks:
    """Return the tracks of the aircraft in a recorded file, in the file's order.

    They are in the plane that touches at the origin, by default where the first sample is. Times
    are the file's own. EncounterSetError says what is wrong with it.
    """
    try:
        recording = recording_of_file(path)
    except TrafficFileError as error:
        raise EncounterSetError(str(error)) from None
    samples = recording.samples
    first = next(iter(samples.values()))
    origin = at or (float(first["lat"][0]), float(first["lon"][0]))
    tracks = []
    for columns in samples.values():
        lat, lon = columns["lat"], columns["lon"]
        north, east, _ = line_of_sight_ned(*origin, 0.0, lat, lon, np.zeros_like(lat))
        tracks.append((columns["time"], north, east, columns["alt"]))
    recording.notes.summarize_aircraft_notes()
    return tracks, origin, [f"{path}: {note}" for note in recording.notes.warnings]
