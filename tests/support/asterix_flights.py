"""The aircraft of an ASTERIX file as flights, read by its own reader alone."""

from pathlib import Path

from components.formats.asterix_file import recording_of_asterix
from components.formats.text_rows import Problems


def read_asterix(path, ownship=None, altitude=None):
    """Return the flights of a file; what is wrong names it."""
    data = Path(path).read_bytes()
    return recording_of_asterix(Problems(str(path)), data, altitude, ownship, least=2).flights()
