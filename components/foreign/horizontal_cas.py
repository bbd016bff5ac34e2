"""HorizontalCAS: turns that neural networks choose (``avoidance.horizontal_cas``).

The published networks (https://github.com/sisl/HorizontalCAS, MIT licence; Julian and Kochenderfer,
"Guaranteeing safety for neural network-based aircraft collision avoidance systems", DASC 2019) are
one for each advisory before and each time to co-altitude; inputs are the intruder's place ahead and
to the left (ft) and its course from ours, anticlockwise. The greatest output is the advice.
"""

import math
import re
from pathlib import Path

import numpy as np
from pydantic import Field

from components.arguments.units import FOOT_M
from components.foreign.nnet_file import Network, read_nnet
from components.messages.alerts import AlertLevels
from components.messages.steering import Manoeuvre, Manoeuvres
from dsa_des.block.component import Component, Input, Output, Parameters, ScenePath
from dsa_des.block.wake import Wake

#: Times to co-altitude that there are networks for, s.
TAUS = (0, 5, 10, 15, 20, 30, 40, 60)
#: Turn rates of the advisories, deg/s to the right: clear, weak left, weak right, strong ones.
RATES_DEG_S = (0.0, -1.5, 1.5, -3.0, 3.0)
_NAME = re.compile(r"pra([0-4])_tau(\d\d)\D")
_INPUTS = 3


class HorizontalCasParameters(Parameters):
    """Parameters of HorizontalCAS."""

    networks: ScenePath = Field(
        description="Folder of .nnet files; names hold praP_tauTT: advisory before, time in s."
    )
    height_m: float = Field(
        default=100.0 * FOOT_M, gt=0, description="Within this height of each other nobody is "
        "separated vertically, m.",
    )  # fmt: skip
    step_s: float = Field(
        default=1.0, gt=0, le=10, description="How long an advisory is flown, s: until the next."
    )


class HorizontalCas(Component):
    """Turns the ownship as networks advise against the target nearest in the horizontal plane.

    Of targets whose heights are or will be the ownship's within a minute; the network is that of
    the last advisory and of the greatest time to co-altitude not above the target's.
    """

    inputs = {"alerts": Input(AlertLevels, "trigger", "Where targets are, whatever their level.")}
    outputs = {"manoeuvres": Output(Manoeuvres, "Turns that the ownship is told to fly.")}
    Parameters = HorizontalCasParameters
    rewindable = True

    def setup(self) -> None:
        """Read all networks; start clear of conflict."""
        self._networks = read_networks(self.p.networks)
        self._advisory = 0

    def run(self, wake: Wake) -> Manoeuvres | None:
        """Evaluate the network that is due, and return a turn for one step."""
        alerts: AlertLevels | None = wake["alerts"]
        if alerts is None:
            return None
        self._advisory = self._advisory_index(alerts)
        rate = math.radians(RATES_DEG_S[self._advisory])
        if rate == 0.0:
            return None
        turn = Manoeuvre(turn_rad=rate * self.p.step_s, rate_rad_s=abs(rate))
        return Manoeuvres.of([int(wake.ticks[0])], [turn])

    def _advisory_index(self, alerts: AlertLevels) -> int:
        there = alerts.relative
        own_east, own_north = (float(alerts.own_motion[n][0]) for n in ("east_mps", "north_mps"))
        course = math.atan2(own_east, own_north)
        nearest, inputs, due = math.inf, np.zeros(_INPUTS), 0
        for k in range(len(alerts.target)):
            east, north, up = (-float(there[name][k]) for name in ("east_m", "north_m", "up_m"))
            climb = -float(there["climb_mps"][k])
            tau_s = time_to_co_altitude(up, climb, self.p.height_m)
            far = math.hypot(east, north)
            if tau_s > TAUS[-1] or far >= nearest:
                continue
            other = math.atan2(
                own_east - float(there["east_mps"][k]), own_north - float(there["north_mps"][k])
            )
            bearing = math.atan2(east, north) - course
            nearest, due = far, max(tau for tau in TAUS if tau <= tau_s)
            inputs = np.array(
                [
                    far * math.cos(bearing) / FOOT_M,
                    -far * math.sin(bearing) / FOOT_M,
                    math.remainder(course - other, 2.0 * math.pi),
                ]
            )
        if not math.isfinite(nearest):
            return 0
        return int(np.argmax(self._networks[self._advisory, due].outputs(inputs)))


def time_to_co_altitude(up_m: float, climb_mps: float, height_m: float) -> float:
    """Return the time (s) to a relative height within ``height_m``: 0 if now, infinite if never."""
    outside_m = abs(up_m) - height_m
    if outside_m <= 0.0:
        return 0.0
    closing = -math.copysign(climb_mps, up_m * climb_mps) if climb_mps else 0.0
    return outside_m / closing if closing > 0.0 else math.inf


def read_networks(folder: Path) -> dict[tuple[int, int], Network]:
    """Return networks by (previous advisory, s to co-altitude); ValueError if one is missing."""
    found: dict[tuple[int, int], Path] = {}
    for path in sorted(folder.glob("*.nnet")):
        if name := _NAME.search(path.name):
            found.setdefault((int(name[1]), int(name[2])), path)
    wanted = [(before, tau) for before in range(len(RATES_DEG_S)) for tau in TAUS]
    missing = [f"pra{before}_tau{tau:02d}" for before, tau in wanted if (before, tau) not in found]
    if missing:
        shown = ", ".join(missing[:3]) + (", ..." if len(missing) > 3 else "")
        raise ValueError(
            f"networks: {folder}: {len(missing)} of {len(wanted)} networks are missing ({shown}): "
            "https://github.com/sisl/HorizontalCAS has them"
        )
    return {key: read_nnet(found[key], _INPUTS, len(RATES_DEG_S)) for key in wanted}
