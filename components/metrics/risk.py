"""Risk of an encounter: losses with and without avoidance, their severity, and the risk ratio;
and how near any two aircraft come.

Every encounter is run without avoidance (*nominal*) and with it (*mitigated*), on the same random
numbers, and has a weight that says how often it happens in the airspace. The risk ratio is what
`dsa_des.results.ratio` computes, under the field's names.
"""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from components.arguments.units import FOOT_M
from components.metrics.encounter import STEP, SizeParameters, distance_field_m
from components.metrics.flown_flights import FlownMetric, make_run_by_run_reader
from components.metrics.losses import run_nearest_range_and_time
from components.metrics.rows import TargetParameters
from components.metrics.separation import (
    RelativeFlight,
    only_traffic_block,
    own_enu_relative_to_target,
)
from components.well_clear.severity import collision_probability, loss_severity_percent
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.results.ratio import METHODS, PairedRatio, paired_ratio
from dsa_des.scene.scene import Scene
from dsa_des.studies.metric import EVENT, FRACTION, NUMBER, Group, Result

__all__ = [
    "METHODS", "LeastSeparation", "Mitigated", "RiskParameters", "RiskRatio", "Severity",
    "risk_ratio", "risk_ratios_by_class",
]  # fmt: skip

RiskRatio = PairedRatio
risk_ratio = paired_ratio

#: By the sizes of their volumes.
_EVENTS = ("well_clear_lost", "nmac")
# The best of the grid is looked at again with this much finer steps to both sides.
_FINER = 50


class RiskParameters(SizeParameters):
    """What counts as a loss of well clear, and as a near mid-air collision, and how it is found."""

    step_s: float | None = STEP


class MitigatedParameters(RiskParameters):
    """Sizes of the events that are counted, and the platform whose pairs count."""

    platform: str | None = Field(
        default=None,
        description="Name of the aircraft from which the others are seen, by default the ownship; "
        "'*' for events between any two.",
    )


class Mitigated(FlownMetric):
    """Events with and without the manoeuvres that the ownship was told to fly."""

    Parameters: ClassVar[Any] = MitigatedParameters
    of_any_two = True

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene)
        if not self.delays_s:
            name = only_traffic_block(scene).name
            raise ValueError(f"nothing steers the ownship: no manoeuvres are wired to {name!r}")

    def results(self) -> list[Result]:
        """Return four results' definitions: loss of well clear, NMAC, nominal and mitigated."""
        sizes = self.p.well_clear_and_nmac_sizes_m
        return [
            Result(f"{name}_{which}", EVENT, f"{how} within {radius:g} m and {half:g} m")
            for name, (radius, half) in zip(_EVENTS, sizes, strict=True)
            for which, how in (("nominal", "without manoeuvres,"), ("mitigated", "as steered,"))
        ]

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return each replica's flags of both events, nominal (no manoeuvres) and mitigated."""
        nominal = self.nominal_event_flags(group)
        mitigated = {name: nominal[f"{name}_nominal"].copy() for name in _EVENTS}
        told = self.steered_replica_indices(group)
        if len(told):
            for name, flags in self.event_flags(group, steered=True, some=told).items():
                mitigated[name][told] = flags
        return {**nominal, **{f"{name}_mitigated": of for name, of in mitigated.items()}}

    def cylinders_m(self) -> Mapping[str, tuple[float, float]]:
        """Return (radius, half height) in m of the mitigated events, by event name."""
        cylinders: dict[str, tuple[float, float]] = self.p.cylinders_m("_mitigated")
        return cylinders

    def nominal_event_flags(self, group: Group) -> dict[str, AnyArray]:
        """Return each replica's flags (1.0 or 0.0) of both events without manoeuvres."""
        return {
            f"{name}_nominal": of for name, of in self.event_flags(group, steered=False).items()
        }

    def event_flags(
        self, group: Group, *, steered: bool, some: IntArray | None = None
    ) -> dict[str, AnyArray]:
        """Return flags (1.0, 0.0) of lost well clear, NMAC in replicas, steered or unmanoeuvred."""
        lost_s, collision_s, _ = self.evaluate_flights(
            group, self.p.loss_nmac_and_start_times_s, steered=steered, some=some
        )
        return {
            name: (~np.isnan(time_s)).astype(float)
            for name, time_s in zip(_EVENTS, (lost_s, collision_s), strict=True)
        }

    def foresee(self, group: Group) -> Mapping[str, AnyArray]:
        """Return each replica's flags of both events as they would be without manoeuvres."""
        return self.nominal_event_flags(group)


class LeastSeparationParameters(RiskParameters):
    """Which pairs of aircraft count, the sizes that define a loss, and how it is computed."""

    platform: str = Field(
        default="*", description="Name of the aircraft whose pairs count; by default any two."
    )
    steered: bool = Field(
        default=True, description="Take flights with everybody's manoeuvres, not as planned."
    )


class LeastSeparation(FlownMetric):
    """How near any two aircraft of a scene come, and whether any two lose separation.

    All pairs count, whoever of them carries a chain; places on the ground are no aircraft.
    """

    Parameters = LeastSeparationParameters
    of_any_two = True

    def __init__(self, parameters: Any, scene: Scene) -> None:
        super().__init__(parameters, scene, steered=parameters.steered)

    def results(self) -> list[Result]:
        """Return the results' definitions: least distance of any pair, its time, both events."""
        results = [
            Result("least_separation_m", NUMBER, "smallest slant range of any two, m", least=0.0),
            Result("least_separation_time_s", NUMBER, "when that is, s", least=0.0),
        ]
        return results + [
            Result(f"any_{name}", EVENT, f"any two within {radius:g} m and {half:g} m")
            for name, (radius, half) in zip(
                _EVENTS, self.p.well_clear_and_nmac_sizes_m, strict=True
            )
        ]

    def cylinders_m(self) -> Mapping[str, tuple[float, float]]:
        """Return each event's (radius, half height), m: NMAC, and LoWC unless by modified tau."""
        cylinders: dict[str, tuple[float, float]] = self.p.cylinders_m()
        return {f"any_{name}": sizes for name, sizes in cylinders.items()}

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return each replica's least range of any pair (m), its time (s), both events' flags."""
        range_m, time_s = self.evaluate_flights(group, run_nearest_range_and_time, to_the_end=True)
        losses = self.evaluate_flights(group, self.p.loss_nmac_and_start_times_s, to_the_end=True)[
            :2
        ]
        return {
            "least_separation_m": range_m,
            "least_separation_time_s": time_s,
            **{
                f"any_{name}": (~np.isnan(of)).astype(float)
                for name, of in zip(_EVENTS, losses, strict=True)
            },
        }


class SeverityParameters(TargetParameters, SizeParameters):
    """Sizes of the boundary, and whose altimeters are which."""

    horizontal_m: float = distance_field_m(4000 * FOOT_M, "Horizontal size of well clear, m.")
    vertical_m: float = distance_field_m(450 * FOOT_M, "Vertical size of well clear, m.")
    tau_s: float = Field(default=35.0, ge=0, le=600, description="Its modified tau, s.")
    mode_c_own: bool = Field(
        default=False,
        description="The ownship's altimeter is that of Mode C, or of no transponder.",
    )
    mode_c_target: bool = Field(
        default=False, description="The targets' altimeters are that of Mode C, or of none."
    )
    step_s: float = Field(
        default=0.1, gt=0, le=10, description="Spacing of the times that are looked at first, s."
    )


class Severity(FlownMetric):
    """Largest severity of a loss of well clear, and probability of a near mid-air collision.

    Of several targets the most severe counts, for each of the two by itself.
    """

    Parameters = SeverityParameters

    def results(self) -> list[Result]:
        """Return the results' definitions: largest severity (percent), NMAC probability."""
        return [
            Result(
                "slowc_percent",
                NUMBER,
                "largest severity of the loss of well clear, percent",
                least=0.0,
                most=100.0,
            ),
            Result("pnmac", FRACTION, "probability of an NMAC, errors of the altimeters included"),
        ]

    def measure(self, group: Group) -> Mapping[str, AnyArray]:
        """Return replicas' largest severity (percent), NMAC probability; NaN without a target."""
        values = self.evaluate_flights(
            group, make_run_by_run_reader(self._severity_and_collision), to_the_end=True
        )
        return {"slowc_percent": values[0], "pnmac": values[1]}

    def _severity_and_collision(self, flights: list[RelativeFlight]) -> tuple[float, ...]:
        each = [
            (self._largest_severity(flight), self._nmac_probability(flight)) for flight in flights
        ]
        values = np.array(each, dtype=np.float64).reshape(-1, 2)
        if not len(values) or np.isnan(values).all():
            return float("nan"), float("nan")
        largest: FloatArray = np.fmax.reduce(values)
        return float(largest[0]), float(largest[1])

    def _largest_severity(self, flight: RelativeFlight) -> float:
        """Return a flight's largest severity, refined at its peak, percent; NaN without times."""
        sizes = self.p.horizontal_m, self.p.vertical_m, self.p.tau_s

        def at(time_s: FloatArray) -> FloatArray:
            return loss_severity_percent(own_enu_relative_to_target(flight, time_s), *sizes)

        best, best_s = float("nan"), float("nan")
        for piece in flight.separations_by_piece():
            time_s = piece.time_s[np.isfinite(piece.range_m)]
            if len(time_s):
                result = at(time_s)
                index = int(np.argmax(result))
                if not result[index] <= best:
                    best, best_s = float(result[index]), float(time_s[index])
        if not best > 0.0:
            return best
        return max(best, float(at(self._refine_times(flight, best_s)).max()))

    def _nmac_probability(self, flight: RelativeFlight) -> float:
        """Return the probability of an NMAC at the horizontal closest approach of a flight."""
        best, best_s = float("inf"), float("nan")
        for piece in flight.separations_by_piece():
            index = int(np.argmin(piece.horizontal_m))
            if piece.horizontal_m[index] < best:
                best, best_s = float(piece.horizontal_m[index]), float(piece.time_s[index])
        if not np.isfinite(best):
            return float("nan")
        time_s = self._refine_times(flight, best_s)
        across_m = flight.separation_at(time_s).horizontal_m
        index = int(np.argmin(across_m))
        own, other = flight.states(time_s[index : index + 1])
        own_m, other_m = (np.asarray(state.alt_m, dtype=np.float64) for state in (own, other))
        result = collision_probability(
            across_m[index],
            own_m - other_m,
            (own_m, other_m),
            (self.p.mode_c_own, self.p.mode_c_target),
            self.p.nmac_horizontal_m,
            self.p.nmac_vertical_m,
        )
        return float(result[0])

    def _refine_times(self, flight: RelativeFlight, time_s: float) -> FloatArray:
        """Return a finer grid around one time, limited to when both aircraft are present, s."""
        first_s, last_s = (float(times[0]) for times in flight.presence_start_and_end_s())
        step_s = self.p.step_s / _FINER
        about = time_s + step_s * np.arange(-_FINER, _FINER + 1)
        return np.clip(about, max(first_s, 0.0), min(last_s, flight.end_s))


def risk_ratios_by_class(
    nominal: npt.ArrayLike,
    mitigated: npt.ArrayLike,
    weight: npt.ArrayLike | None,
    labels: npt.ArrayLike,
    cluster: npt.ArrayLike | None = None,
    **options: object,
) -> dict[str, RiskRatio]:
    """Return the risk ratio of each class of encounters, sorted by class name.

    Parameters
    ----------
    nominal, mitigated, weight
        As in `risk_ratio`.
    labels : (encounters,)
        The class of each, for example of its geometry.
    cluster : (encounters,), optional
    **options
        Keywords of `risk_ratio`.
    """
    n, m, names = np.asarray(nominal), np.asarray(mitigated), np.asarray(labels)
    w = np.ones(len(n)) if weight is None else np.asarray(weight)
    ratio: Callable[..., RiskRatio] = paired_ratio
    if len(names) != len(n):
        raise ValueError(f"there are {len(names)} classes for {len(n)} encounters")
    ratios = {}
    for name in np.unique(names):
        mine = names == name
        together = None if cluster is None else np.asarray(cluster)[mine]
        ratios[str(name)] = ratio(n[mine], m[mine], w[mine], cluster=together, **options)
    return ratios
