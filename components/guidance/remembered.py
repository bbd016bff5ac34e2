"""Bands and resolutions over time, as guidance remembers them."""

from typing import NamedTuple

from components.alert_configuration.configuration import Configuration
from components.guidance.band_memory import BandMemory
from components.guidance.bands import Guidance
from components.guidance.intervals import Band
from components.guidance.resolution import Resolution, resolution
from components.guidance.resolution_memory import ResolutionMemory


class Remembered(NamedTuple):
    """The bands of one kind at one instant, and the way out of them.

    Parameters
    ----------
    bands : list of Band
    resolution : Resolution or None
    """

    bands: list[Band]
    resolution: Resolution | None


class GuidanceMemory:
    """What is remembered of the guidance of one kind, for one ownship.

    Parameters
    ----------
    configuration : Configuration
        With `hysteresis_time` 0 every instant stands by itself.
    kind_name : {"hdir", "hs", "vs", "alt"}
    """

    def __init__(self, configuration: Configuration, kind_name: str) -> None:
        self._cyclic = kind_name == "hdir"
        self._corrective: str = configuration["corrective_region"]
        self._bands = BandMemory(configuration, self._cyclic)
        self._resolutions = ResolutionMemory(configuration, kind_name)

    def step(self, now_s: float, found: Guidance) -> Remembered:
        """Take in the guidance of one instant, later than the last, and return what is shown."""
        own_value, recovery = found.own_value, found.recovery
        bands = self._bands.step(now_s, found.line, own_value, recovery)
        way = resolution(bands, own_value, self._corrective, self._cyclic)
        shown = self._resolutions.step(now_s, way, bands, own_value, recovery)
        return Remembered(bands, shown)
