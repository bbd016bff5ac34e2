"""The base class of radar blocks: it measures range, and effects act on its echoes."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from components.geometry.attitude import body_to_ned, unit_vector
from components.messages.detections import OwnOfEntries
from components.messages.reach import farthest_look
from components.messages.targets import RelativeTargets
from components.radar.beam_effects import BeamSweep, Sweep
from components.radar.moving_target_filter import folded_range_rate
from components.radar.own_velocity import OwnVelocity, own_velocity
from components.radar.range_rate import LASTS_S, RangeRate
from components.radar.resolution_effects import Merging
from components.sensor.look import Cells
from components.sensor.marks import RADAR
from components.sensor.sensor import Sensor
from dsa_des.arrays.types import BoolArray, FloatArray, IntArray
from dsa_des.block.effect import Effect
from dsa_des.block.message import Message

_RANGE_RATE, _OWN_VELOCITY = RangeRate(), OwnVelocity()
CellFactor = Callable[[Cells], FloatArray]
#: Over ground, of the fastest aircraft that a radar listens for: a jet's at cruise.
FASTEST_M_S = 250.0


class Radar(Sensor):
    """A sensor that measures range; subclasses decide what is detected."""

    mark = RADAR
    measures_range = True
    #: Of the carrier, m; None where it is not known.
    wavelength_m: float | None = None
    hooks = {
        "SNR": "(cells) -> factor of each cell's SNR",
        "Doppler": "(cells) -> factors on the power of each cell's target and of its ground",
        "range rate": "(cells, found) -> rate of some cells' slant range, m/s",
        "one report by cell": "(cells, power) -> power of the echo that stands for its "
        "resolution cell, 0 of the others",
    }

    effects: ClassVar[tuple[Effect, ...]] = (_RANGE_RATE, _OWN_VELOCITY)
    also_records: ClassVar[tuple[type[Message], ...]] = (*Sensor.also_records, OwnOfEntries)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        # Their key is one of every radar. The velocity is of what the reports before it say:
        # false alarms, and when a sweeping beam met whom.
        both = (_RANGE_RATE, _OWN_VELOCITY)
        others = tuple(effect for effect in cls.effects if effect not in both)
        cls.effects = (_RANGE_RATE, *others, _OWN_VELOCITY)

    def __init__(self, name: str, parameters: Any, context: Any) -> None:
        super().__init__(name, parameters, context)
        self.snr_factors: list[CellFactor] = []
        self._merging: Merging | None = None
        self.doppler: Any = None
        self.range_rate_step_m_s = float(getattr(parameters, "range_rate_resolution_m_s", 0.0))

    def setup(self) -> None:
        """Take what the scene's effects do to the SNR."""
        self.snr_factors = self.built("SNR")
        (self.doppler,) = self.built("Doppler") or [None]
        (self._merging,) = self.built("one report by cell") or [None]

    def resolved(self, cells: Cells, power: FloatArray) -> FloatArray:
        """Return the power of each echo that the radar can tell from others, and 0 of the rest."""
        return power if self._merging is None else self._merging(cells, power)

    def records(self) -> list[type[Message]]:
        """Return what is recorded: where the beam sweeps, the ownship at each entry's instant."""
        return [*super().records(), *([] if self._sweep is None else [OwnOfEntries])]

    @property
    def _sweep(self) -> Sweep | None:
        return self.context.effects.get(BeamSweep.name)

    def request(self, port: str) -> Any:
        """Ask for the targets in our reach; a sweeping beam decides for itself when that is."""
        reach = super().request(port)
        if not self.p.enabled:
            return reach
        lasts_s = LASTS_S if self._rates or self.built("Doppler") else 0.0
        if self._sweep is None:
            return replace(reach, lasts_s=lasts_s)
        return replace(farthest_look([reach]), lasts_s=lasts_s + self._sweep.period_s)

    def offer(self, port: str) -> Any:
        """Say beside what every sensor says whether range rates fold."""
        folds = bool(getattr(self.p, "range_rate_folds", False))
        return replace(super().offer(port), folds_range_rate=folds)

    def exact_because(self) -> str:
        """A rate divides the change of an error over hundredths of a second by these."""
        return f"{self.name} measures range rates" if self._rates else ""

    @cached_property
    def _rates(self) -> list[Any]:
        return self.built("range rate")

    @property
    def steps(self) -> dict[str, float]:
        """Grid step of each quantity that is measured: rad, m and m/s."""
        measured = getattr(self.p, "measures_range_rate", False)
        rate = {"range_rate": self.range_rate_step_m_s} if measured else {}
        return {**super().steps, **rate}

    def range_rate(self, cells: Cells, found: IntArray) -> FloatArray | None:
        """Return the true range rates of some cells, m/s; None where they are not measured."""
        return self._rates[0](cells, found) if self._rates else None

    def _in_body(
        self, values: Mapping[str, FloatArray], variances: Mapping[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
        """Return what is measured, range rates as one PRF takes them where they fold."""
        azimuth, elevation, range_m, beside = super()._in_body(values, variances)
        if self.p.range_rate_folds and "range_rate_m_s" in beside:
            assert self.wavelength_m is not None
            limit_m_s = 0.25 * self.wavelength_m * self.p.prf_hz
            folded = folded_range_rate(beside["range_rate_m_s"], limit_m_s)
            beside = {**beside, "range_rate_m_s": folded}
        return azimuth, elevation, range_m, beside

    def noise_range_rate(
        self,
        uniform: FloatArray,
        where: Mapping[str, FloatArray],
        targets: RelativeTargets,
        row: IntArray,
    ) -> FloatArray:
        """Return range rates that noise alone gives, m/s: any that the radar listens for.

        One of one PRF listens for all that are unambiguous; another for those of aircraft up to
        `FASTEST_M_S` over ground, by its own motion along the line of sight.

        Parameters
        ----------
        uniform : (n,) array
            In [0, 1).
        where : mapping of (n,)
            Directions in the sensor's axes.
        targets : RelativeTargets
        row : (n,) of int
            Of the targets.
        """
        off = 2.0 * uniform - 1.0
        if self.p.range_rate_folds:
            assert self.wavelength_m is not None
            return off * 0.25 * self.wavelength_m * self.p.prf_hz
        each, place = np.unique(row, return_inverse=True)
        tick = (targets.tick if targets.state_tick is None else targets.state_tick)[each]
        if self.span_ticks:
            tick = tick % self.span_ticks
        velocity = own_velocity(targets, each, tick / self.context.ticks_per_s)
        body = unit_vector(*self.axes.pointing(where["azimuth"], where["elevation"]))
        attitude = targets.own_attitude
        if attitude is None or not np.isfinite(velocity).all():
            return off * FASTEST_M_S
        turned = (attitude[f"{name}_rad"][row] for name in ("yaw", "pitch", "roll"))
        towards = np.stack(body_to_ned(*body, *turned))
        nearer_m_s: FloatArray = (towards * velocity[:, place]).sum(axis=0)
        return off * FASTEST_M_S - nearer_m_s

    def seen(
        self, targets: RelativeTargets, rows: IntArray, cued: BoolArray | None = None
    ) -> tuple[RelativeTargets, IntArray]:
        """Return the targets at the instants at which the beam lights them."""
        if self._sweep is None:
            return targets, rows
        return self._sweep.lit(targets, rows, cued), np.arange(len(rows))
