"""Bands of guidance in a scene, for displays and records (``guidance.daidalus``)."""

import math

import numpy as np
from pydantic import Field

from components.alert_configuration.conf_parameters import ConfParameters
from components.guidance.way_out import bands_around
from components.messages.alerts import BAND_KINDS, BAND_REGIONS, AlertLevels, GuidanceBands
from dsa_des.block.component import Component
from dsa_des.block.message import offsets_of
from dsa_des.block.ports import Input, Output
from dsa_des.block.wake import Wake

_NAMES = {"direction": "hdir", "altitude": "alt"}


class GuidanceParameters(ConfParameters):
    """Parameters of guidance."""

    level: int = Field(
        default=1, ge=0, description="Bands are given where an alert is of this level or above."
    )


class DaidalusGuidance(Component):
    """Which directions and altitudes lose separation, by the rules of DAIDALUS (RTCA DO-365).

    Over all targets whose flights the alerting knows, at each of its scans by itself. It steers
    nobody; `avoidance.daidalus` flies out of the same bands.
    """

    inputs = {"alerts": Input(AlertLevels, "trigger", "The alert level of each target.")}
    outputs = {"bands": Output(GuidanceBands, "Directions and altitudes that lose separation.")}
    Parameters = GuidanceParameters
    windowed = True
    lockstep = True
    rewindable = True

    def setup(self) -> None:
        """Read the configuration."""
        self._configuration, self._alerter = self.p.read()

    def run(self, wake: Wake) -> GuidanceBands | None:
        """Give the bands of every instant with an alert."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        rows = np.flatnonzero(alerts.highest() >= self.p.level).tolist()
        found: list[tuple[int, int, int, float, float]] = []
        for number, kind in enumerate(BAND_KINDS):
            every = bands_around(_NAMES[kind], self._configuration, self._alerter, alerts, rows)
            for place, guided in enumerate(every):
                found += [
                    (place, number, BAND_REGIONS.index(band.region), band.low, band.high)
                    for band in (() if guided is None else guided.bands)
                    if band.region != "NONE"
                ]
        if not found:
            return None
        found.sort(key=lambda one: one[0])
        table = np.array(found)
        line, code = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
        turned = code == BAND_KINDS.index("direction")
        ends = [
            np.where(where, table[:, k], math.nan) for where in (turned, ~turned) for k in (3, 4)
        ]
        region = table[:, 2].astype(np.int64)
        ticks = wake.ticks[np.array(rows, dtype=np.int64)]
        return GuidanceBands(ticks, offsets_of(line, len(rows)), code, region, *ends)
