"""Which sampled tracks are flights: the rules by which the published programs reject tracks.

A track is drawn again (next attempt of the same number) where

- it climbs at time 0 as fast as it flies, or faster;
- it leaves the outer edges of the altitude layers;
- its speed leaves the upper edges of the bins that hold the 1 % and the 99 % point of speeds, given
  its geographic area, airspace and layer (of fixed wing models also where it is below 30 ft/s);
- its vertical rate is larger than the larger of the two such edges of vertical rates.

Distributions are those before rejection (`TrackSampler`); what is left is not the model's any more.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from components.encounters.model import (
    ACCELERATION,
    AIRSPACE,
    CLIMB,
    GEOGRAPHY,
    LAYER,
    LAYERS_FT,
    SPEED,
    TURN,
    BayesNetwork,
    EncounterModel,
)
from components.encounters.sampling import SampledTracks, TrackSampler
from components.flights.point_mass import DYNAMICS, FT_S_PER_KT, FlownTracks
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.errors import did_you_mean

_SHARES = (0.01, 0.99)
_SLOWEST_FIXED_WING_FT_S = 30.0
_MOST_ATTEMPTS = 2000
_MOST_CELLS = 20_000_000
#: Point-mass flights hold eight arrays of ten instants per second.
_TRACKS_AT_ONCE = 512
_FLOWN = (SPEED, ACCELERATION, CLIMB, TURN, LAYER)


class TrackError(ValueError):
    """A model's tracks cannot be flown, or none of them is accepted; it names the model's file."""


def _explain_missing_variable(model: EncounterModel, label: str) -> str:
    """Return the words that explain why a model without this variable cannot be flown."""
    there = {*model.labels}
    if {"v_1", "v_2", "hmd", "vmd"} <= there:
        return (
            "it is a correlated model, of two aircraft at their closest approach: only models of "
            "one aircraft (uncorrelated ones) are flown"
        )
    if there <= {LAYER, CLIMB}:
        return "it is a model of balloons, which have no speed of their own: they are not flown"
    return (
        f"the model has no variable {label!r}{did_you_mean(label, model.labels)}: its tracks "
        "cannot be flown"
    )


@dataclass(frozen=True)
class Commands:
    """Sampled commands: altitude, speed at 0 s (tracks,), rates by second (seconds + 1, tracks)."""

    altitude_ft: FloatArray
    speed_ft_s: FloatArray
    acceleration_ft_s2: FloatArray
    climb_ft_s: FloatArray
    turn_rad_s: FloatArray

    def take(self, rows: IntArray) -> "Commands":
        """Return the commands of the tracks with these indices."""
        return Commands(*(values.take(rows, axis=-1) for values in vars(self).values()))

    def fly(self, dynamics: str) -> FlownTracks:
        """Return the flown tracks, by the dynamics ``euler`` or ``point_mass``."""
        return DYNAMICS[dynamics](
            self.altitude_ft,
            self.speed_ft_s,
            self.acceleration_ft_s2,
            self.climb_ft_s,
            self.turn_rad_s,
        )


class TrackRules:
    """Turns a model's sampled tracks into commands, and tells which tracks are accepted."""

    def __init__(self, model: EncounterModel) -> None:
        self.model = model
        for label in _FLOWN:
            if model.index_of(label) is None:
                raise TrackError(
                    f"{model.path}: {_explain_missing_variable(model, label)} "
                    "(--raw writes what it gives)"
                )
        self._layer = self._index_of(LAYER)
        bins = model.bins[self._layer]
        edges = bins.edges
        if edges is None:
            if bins.size > len(LAYERS_FT) - 1:
                raise TrackError(
                    f"{model.path}: variable {LAYER!r} has {bins.size} layers without edges; known "
                    f"are the edges of {len(LAYERS_FT) - 1}"
                )
            edges = np.array(LAYERS_FT[: bins.size + 1])
        self._edges_ft = edges
        self._given = [
            p for p in map(model.index_of, (GEOGRAPHY, AIRSPACE, LAYER)) if p is not None
        ]
        self._speed_ft_s, climbs = (
            self._low_and_high_quantiles(label) * factor
            for label, factor in ((SPEED, FT_S_PER_KT), (CLIMB, 1.0 / 60.0))
        )
        self._climb_ft_s = np.abs(climbs).max(axis=0)
        if "fw" in model.name:
            self._speed_ft_s[0] = np.maximum(self._speed_ft_s[0], _SLOWEST_FIXED_WING_FT_S)

    def _index_of(self, label: str) -> int:
        index = self.model.index_of(label)
        assert index is not None
        return index

    def layer_edges_ft(self, tracks: SampledTracks) -> tuple[FloatArray, FloatArray]:
        """Return the lower and the upper edge, ft, of the altitude layer of each track."""
        layer = tracks.initial_bins[self._layer]
        return self._edges_ft[layer], self._edges_ft[layer + 1]

    def initial_altitude_ft(self, tracks: SampledTracks) -> FloatArray:
        """Return altitudes at time 0, uniform in their layers."""
        low, high = self.layer_edges_ft(tracks)
        result: FloatArray = low + (high - low) * tracks.left[self._layer]
        return result

    def commands(self, tracks: SampledTracks) -> Commands:
        """Return the commands of tracks, in feet and seconds."""
        return Commands(
            self.initial_altitude_ft(tracks),
            tracks.initial[self._index_of(SPEED)] * FT_S_PER_KT,
            self._values_by_second(tracks, ACCELERATION) * FT_S_PER_KT,
            self._values_by_second(tracks, CLIMB) / 60.0,
            np.radians(self._values_by_second(tracks, TURN)),
        )

    def _values_by_second(self, tracks: SampledTracks, label: str) -> FloatArray:
        index, dynamic = self._index_of(label), self.model.dynamic_indices
        if index in dynamic:
            result: FloatArray = tracks.changing[:, dynamic.index(index)]
            return result
        return np.broadcast_to(
            tracks.initial[index], (len(tracks.changing), len(tracks.numbers))
        ).copy()

    def is_accepted(self, tracks: SampledTracks, flown: FlownTracks) -> BoolArray:
        """Return which flown tracks keep the limits of speed, vertical rate and model altitudes."""
        good = self.keeps_limits(tracks, flown.climb_ft_s, flown.speed_ft_s)
        return good & self.stays_within_altitudes(flown.up_ft)

    def keeps_limits(
        self, tracks: SampledTracks, climb_ft_s: FloatArray, speed: FloatArray
    ) -> BoolArray:
        """Return a mask of tracks that keep the limits of speed (ft/s) and vertical rate, and whose
        initial speed exceeds their vertical rate.
        """
        slowest, fastest = self._speed_ft_s[:, self._combination_index(tracks)]
        good: BoolArray = speed[0] > np.abs(climb_ft_s[0])
        good &= (speed.min(axis=0) >= slowest) & (speed.max(axis=0) <= fastest)
        steepest = self.steepest_climb_ft_s(tracks)
        return good & (climb_ft_s.max(axis=0) <= steepest) & (climb_ft_s.min(axis=0) >= -steepest)

    def stays_within_altitudes(self, up_ft: FloatArray) -> BoolArray:
        """Return which tracks stay within the model's outermost altitudes, and not below 0 ft."""
        lowest = max(float(self._edges_ft[0]), 0.0)
        good: BoolArray = up_ft.min(axis=0) >= lowest
        return good & (up_ft.max(axis=0) <= self._edges_ft[-1])

    def steepest_climb_ft_s(self, tracks: SampledTracks) -> FloatArray:
        """Return the largest size of vertical rate, ft/s, that is accepted of each track."""
        # Rounding alone must not reject the value on the edge itself.
        result: FloatArray = self._climb_ft_s[self._combination_index(tracks)] * (1.0 + 1e-9)
        return result

    def _combination_index(self, tracks: SampledTracks) -> IntArray:
        """Return the index of each track's combination of area, airspace and altitude layer."""
        result: AnyArray = np.zeros(len(tracks.numbers), dtype=np.int64)
        for index in self._given:
            result = result * self.model.initial.sizes[index] + tracks.initial_bins[index]
        return result

    def _low_and_high_quantiles(self, label: str) -> FloatArray:
        """Return a variable's low and high quantile by area, airspace, layer (2, combinations)."""
        index = self._index_of(label)
        edges = self.model.bins[index].edges
        if edges is None:
            raise TrackError(
                f"{self.model.path}: variable {label!r} has no edges: its values are no rates"
            )
        try:
            table = conditional_distribution(self.model.initial, self._given, index)
        except TrackError as error:
            raise TrackError(f"{self.model.path}: {error}") from None
        summed = np.cumsum(table, axis=1)
        low, high = (np.argmax(summed >= share - 1e-12, axis=1) for share in _SHARES)
        result = np.stack([edges[low + 1], edges[high + 1]])
        # Where both points lie in one bin, all of the bin is usual.
        result[0] = np.where(low == high, edges[low], result[0])
        return result


def conditional_distribution(network: BayesNetwork, given: list[int], index: int) -> FloatArray:
    """Return a variable's exact bin probabilities given other variables, (combinations, bins).

    The last one given runs fastest; combinations that cannot be have the distribution over all.
    """
    needed, todo = set(), [*given, index]
    while todo:
        item = todo.pop()
        if item not in needed:
            needed.add(item)
            todo += network.nodes[item].parents
    order = sorted(needed)
    sizes = [network.sizes[item] for item in order]
    if np.prod(sizes, dtype=float) > _MOST_CELLS:
        raise TrackError(f"variable {network.labels[index]!r} depends on too many others")
    cells = np.indices(sizes).reshape(len(order), -1)
    bins = {item: cells[k] for k, item in enumerate(order)}
    chance = np.ones(cells.shape[1])
    for item in order:
        node = network.nodes[item]
        column: AnyArray = np.zeros(cells.shape[1], dtype=np.int64)
        for parent, stride in zip(node.parents, node.strides, strict=True):
            column = column + stride * bins[parent]
        chance = chance * node.probabilities[column, bins[item]]
    row: AnyArray = np.zeros(cells.shape[1], dtype=np.int64)
    count = 1
    for item in given:
        row, count = row * network.sizes[item] + bins[item], count * network.sizes[item]
    size = network.sizes[index]
    joint = np.bincount(row * size + bins[index], weights=chance, minlength=count * size)
    table = joint.reshape(count, size)
    table = np.where(table.sum(axis=1, keepdims=True) > 0.0, table, table.sum(axis=0))
    result: FloatArray = table / table.sum(axis=1, keepdims=True)
    return result


def sample_accepted_tracks(
    sampler: TrackSampler, rules: TrackRules, numbers: range, seconds: int, dynamics: str
) -> Iterator[tuple[SampledTracks, FlownTracks]]:
    """Yield batches of accepted tracks and flights; each number is sampled until accepted."""
    for start in range(0, len(numbers), _TRACKS_AT_ONCE):
        some = numbers[start : start + _TRACKS_AT_ONCE]
        kept: SampledTracks | None = None
        left = np.arange(len(some))
        for attempt in range(_MOST_ATTEMPTS):
            tracks = sampler.sample([some[k] for k in left], seconds, attempt)
            commands = rules.commands(tracks)
            flown = commands.fly(dynamics)
            good = rules.is_accepted(tracks, flown)
            if kept is None:
                kept = tracks
            else:
                kept.replace(left[good], tracks, good)
            left = left[~good]
            if not len(left):
                break
        else:
            number = some[int(left[0])]
            raise TrackError(
                f"{rules.model.path}: track {number} was rejected {_MOST_ATTEMPTS} times"
            )
        assert kept is not None
        yield kept, rules.commands(kept).fly(dynamics)
