"""What every radar block has in common: it measures range, and effects act on its echoes."""

from collections.abc import Callable
from typing import Any

from components.sensor import Cells, Sensor
from dsa_des.types import FloatArray

CellFactor = Callable[[Cells], FloatArray]


class Radar(Sensor):
    """A sensor that measures range; subclasses decide what is detected."""

    measures_range = True

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.snr_factors: list[CellFactor] = []

    def setup(self) -> None:
        """Take what the scene's effects do to the SNR."""
        self.snr_factors = self.built("SNR")
