"""Uncorrelated encounters: two independent tracks paired on a cylinder, with importance weights.

After the published pairing of uncorrelated encounters (em-pairing-uncor-importancesampling). A pair
is a proposal that is accepted or drawn again under the next attempt number:

1. Both tracks are drawn independently and keep the rules of `TrackRules`.
2. The vertical miss distance at the closest approach is accepted with probability P(vmd). Of two
   tracks the altitude in its layer is uniform and says nothing of how they fly, so it is drawn
   here, given that, from what P leaves of its layer. That accepts the same pairs with the same
   chance, and most that fail are rejected before they have been flown.
3. The intruder's course is uniform, accepted with |v_rel(ψ)| / |v_rel(head-on)|.
4. The signed horizontal miss distance has the density q.
5. The weight undoes 2 to 4: w = S [1 / (2 · 60761 ft)] / q(hmd) / P(vmd), where S is the relative
   speed integrated over courses.
6. Pairs that begin near each other, or are closest before the time they should be, are rejected.

Courses are accepted by the speeds at the closest approach, as S has them (upstream takes those at
time 0 for one and those at the closest approach for the other).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from components.arguments.units import FOOT_M
from components.encounters.model import EncounterModel
from components.encounters.pair_densities import (
    REFERENCE_FT,
    PairingRules,
    relative_speed_over_directions,
)
from components.encounters.sampling import EncounterDraws, Ints, TrackSampler
from components.encounters.track_rules import Commands, TrackError, TrackRules
from components.flights.point_mass import cumulative_sums, fly_euler
from components.formats.encounter_set import EVENTS, NAMES, EncounterSet, geometry_class
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray

#: Pairs that are made together, and attempts of them that are looked at together.
PAIRS_AT_ONCE = 6144
_FLIGHTS_AT_ONCE, _MOST_EACH, _MOST_AT_ONCE = 2048, 6, 256
COURSES, _COURSES_FROM = 40, 4
_MOST_ATTEMPTS = 1_000_000


_PATHS = ("north_ft", "east_ft", "up_ft", "heading_rad", "speed_ft_s")


@dataclass(frozen=True)
class Pairs:
    """Sampled encounters (pairs,); arrays (2, seconds + 1, pairs) have the ownship first.

    Miss distances are those at the closest approach, signed, and intruder above ownship;
    `course_rad` is the intruder's then, when the ownship's is 0, and the origin where the ownship
    is. `attempts` proposals were rejected before. Turns and accelerations are commands, held from
    each second on.
    """

    numbers: IntArray
    weight: FloatArray
    horizontal_ft: FloatArray
    vertical_ft: FloatArray
    course_rad: FloatArray
    attempts: IntArray
    north_ft: FloatArray
    east_ft: FloatArray
    up_ft: FloatArray
    heading_rad: FloatArray
    speed_ft_s: FloatArray
    climb_ft_s: FloatArray
    turn_rad_s: FloatArray
    acceleration_ft_s2: FloatArray

    def take(self, rows: IntArray) -> "Pairs":
        """Return the pairs with these indices, in this order."""
        return Pairs(**{name: values.take(rows, axis=-1) for name, values in vars(self).items()})

    def at_start(self) -> "Pairs":
        """Return the pairs with their paths at time 0 only; commands stay."""
        paths = {name: getattr(self, name)[:, :1] for name in _PATHS}
        return replace(self, **paths)


class PairSampler:
    """Samples encounters of two models by number; the same number gives the same encounter."""

    def __init__(
        self, own: EncounterModel, intruder: EncounterModel, seed: int, rules: PairingRules
    ) -> None:
        self.rules = rules
        self._tracks = [
            TrackSampler(model, EncounterDraws(seed, f"{role} tracks"))
            for model, role in ((own, "ownship"), (intruder, "intruder"))
        ]
        self._rules = [TrackRules(own), TrackRules(intruder)]
        self._draws = EncounterDraws(seed, "pairs")

    def batches(self, numbers: range) -> Iterator[Pairs]:
        """Yield a range's pairs in batches that fit in memory, with positions at time 0 only."""
        for start in range(0, len(numbers), PAIRS_AT_ONCE):
            yield self.sample_pairs(numbers[start : start + PAIRS_AT_ONCE], paths=False)

    def sample_pairs(self, numbers: Ints, *, paths: bool = True) -> Pairs:
        """Return accepted pairs by ascending numbers, with whole paths or positions at time 0."""
        wanted = np.asarray(numbers, dtype=np.int64)
        parts: list[Pairs] = []
        left, attempt = np.arange(len(wanted)), np.zeros(len(wanted), dtype=np.int64)
        passed = 1.0
        while len(left):
            # As many proposals of each as make it likely that a batch is worth flying.
            each = min(_MOST_EACH, max(1, _FLIGHTS_AT_ONCE // len(left)))
            many = min(_MOST_AT_ONCE, max(1, round(each / max(passed, 0.02))))
            rows = np.repeat(left, many)
            tries = np.repeat(attempt[left], many) + np.tile(np.arange(many), len(left))
            hopeful, narrow, bound = self._hopeful_proposals(wanted[rows], tries)
            passed = len(hopeful) / len(rows)
            rows, tries = rows[hopeful], tries[hopeful]
            attempt[left] += many
            done, kept, pairs = self._accepted_proposals(wanted[rows], tries, narrow, bound)
            if pairs is not None:
                # Of several that are accepted the first attempt counts.
                fresh, first = np.unique(rows[done], return_index=True)
                parts.append((pairs if paths else pairs.at_start()).take(kept[first]))
                left = np.setdiff1d(left, fresh, assume_unique=True)
            if len(left) and attempt[left].max() > _MOST_ATTEMPTS:
                own, intruder = (rules.model.path for rules in self._rules)
                raise TrackError(
                    f"{own} and {intruder}: pair {wanted[left[0]]} was rejected {_MOST_ATTEMPTS} "
                    "times: the two models do not meet"
                )
        together = _concatenate(parts)
        return together.take(np.argsort(together.numbers))

    def _hopeful_proposals(
        self, numbers: IntArray, attempts: IntArray
    ) -> tuple[IntArray, AnyArray, AnyArray]:
        """Return the indices of proposals not ruled out by their first second, which aircraft's
        layer is narrower (0 or 1), and the chance with which each was let through.

        With them go which aircraft's layer is the narrower one, whose altitude is kept, and the
        chance with which they were let through.
        """
        both = [t.sample(numbers, 0, attempts) for t in self._tracks]
        good: BoolArray = np.ones(len(numbers), dtype=np.bool_)
        for rules, tracks in zip(self._rules, both, strict=True):
            commands = rules.commands(tracks)
            good &= rules.keeps_limits(tracks, commands.climb_ft_s, commands.speed_ft_s[np.newaxis])
        layers = np.array([r.layer_edges_ft(t) for r, t in zip(self._rules, both, strict=True)])
        width = layers[:, 1] - layers[:, 0]
        narrow = (width[1] < width[0]).astype(np.int64)
        here = np.arange(len(numbers))
        altitudes = np.array(
            [r.initial_altitude_ft(t) for r, t in zip(self._rules, both, strict=True)]
        )
        kept = altitudes[narrow, here]
        most = sum(r.steepest_climb_ft_s(t) for r, t in zip(self._rules, both, strict=True))
        climbs = most * self.rules.closest_s
        low, high = (layers[1 - narrow, k, here] - kept for k in (0, 1))
        reach = np.abs(self.rules.vertical_ft.edges[[0, -1]]).max()
        good &= (low - climbs < reach) & (high + climbs > -reach)
        accept = self.rules.vertical_ft
        bound = np.minimum(1.0, accept.area / accept.heights.max() / width[1 - narrow, here])
        drawn = self._draws.uniform_fast(numbers, 1, attempts)[0]
        hopeful = np.flatnonzero(good & (drawn < bound))
        return hopeful, narrow[hopeful], bound[hopeful]

    def _accepted_proposals(
        self, numbers: IntArray, attempts: IntArray, narrow: IntArray, bound: FloatArray
    ) -> tuple[IntArray, IntArray, Pairs | None]:
        """Return accepted proposals' indices, rows in returned pairs, and these pairs or None."""
        if not len(numbers):
            return numbers, numbers, None
        rules, cpa = self.rules, self.rules.closest_s
        # Whoever breaks a rule alone is not flown with the other.
        own = self._sample_flight(0, numbers, attempts)
        rows = own.flies.nonzero()[0]
        own, narrow, bound = own.take(rows), narrow[rows], bound[rows]
        other = self._sample_flight(1, numbers[rows], attempts[rows])
        both = own, other
        drawn = self._draws.uniform_fast(numbers[rows], _COURSES_FROM, attempts[rows])
        here = np.arange(len(rows))
        climbed = np.array([f.commands.climb_ft_s[:cpa].sum(axis=0) for f in both])
        altitude = np.array([f.commands.altitude_ft for f in both])
        layers = np.array([(f.low_ft, f.high_ft) for f in both])
        wide = 1 - narrow
        at_cpa = (altitude + climbed)[narrow, here]
        # Where the intruder can be above the ownship at the closest approach.
        low, high = (layers[wide, k, here] + climbed[wide, here] - at_cpa for k in (0, 1))
        low, high = np.where(wide == 1, low, -high), np.where(wide == 1, high, -low)
        accept = rules.vertical_ft
        below = accept.integral_to(low)
        area = accept.integral_to(high) - below
        width = layers[wide, 1, here] - layers[wide, 0, here]
        good = drawn[1] * width * bound * accept.heights.max() < area
        vertical = accept.quantile_of_area(below + drawn[2] * area)
        sign = np.where(wide == 1, 1.0, -1.0)
        altitude[wide, here] = at_cpa + sign * vertical - climbed[wide, here]
        good &= other.flies
        done = good.nonzero()[0]
        for k, flight in enumerate(both):
            climb = flight.commands.climb_ft_s[:, done]
            done = done[
                self._rules[k].stays_within_altitudes(cumulative_sums(altitude[k, done], climb))
            ]
        if not len(done):
            return done, done, None
        commands = [f.commands.take(done) for f in both]
        for k, c in enumerate(commands):
            c.altitude_ft[:] = altitude[k, done]
        rows = rows[done]
        more = self._draws.uniform_fast(numbers[rows], _COURSES_FROM + 2 * COURSES, attempts[rows])
        pairs = self._fly_pairs(numbers[rows], attempts[rows], commands, vertical[done], more[3:])
        kept = self._is_accepted(pairs).nonzero()[0]
        return rows[kept], kept, pairs

    def _sample_flight(self, which: int, numbers: IntArray, attempts: IntArray) -> "_Flight":
        """Return one aircraft's commands of sampled tracks, and which keep the model's limits."""
        rules = self._rules[which]
        tracks = self._tracks[which].sample(numbers, self.rules.duration_s, attempts)
        commands = rules.commands(tracks)
        speed = cumulative_sums(commands.speed_ft_s, commands.acceleration_ft_s2)
        good = rules.keeps_limits(tracks, commands.climb_ft_s, speed)
        return _Flight(commands, good, *rules.layer_edges_ft(tracks))

    def _fly_pairs(
        self,
        numbers: IntArray,
        attempts: IntArray,
        commands: list[Commands],
        vertical: FloatArray,
        drawn: FloatArray,
    ) -> Pairs:
        """Return pairs of tracks, flown and moved to their drawn positions at closest approach."""
        cpa = self.rules.closest_s
        flown = [
            fly_euler(c.altitude_ft, c.speed_ft_s, c.acceleration_ft_s2, c.climb_ft_s, c.turn_rad_s)
            for c in commands
        ]
        first, second = (f.speed_ft_s[cpa] for f in flown)
        climb = flown[1].climb_ft_s[cpa] - flown[0].climb_ft_s[cpa]
        course = draw_intruder_courses_rad(first, second, climb, drawn[1:])
        density = self.rules.horizontal_ft
        horizontal = density.quantile_of_area(drawn[0] * density.area)
        north = second * np.cos(course) - first
        east = second * np.sin(course)
        relative = np.maximum(np.hypot(north, east), 1e-9)
        positions = (
            (np.zeros_like(first), np.zeros_like(first)),
            (horizontal * east / relative, -horizontal * north / relative),
        )
        norths, easts, headings = [], [], []
        for f, at, wanted in zip(flown, positions, (0.0, course), strict=True):
            turned = wanted - f.heading_rad[cpa]
            n, e = f.north_ft - f.north_ft[cpa], f.east_ft - f.east_ft[cpa]
            cos, sin = np.cos(turned), np.sin(turned)
            norths.append(at[0] + n * cos - e * sin)
            easts.append(at[1] + n * sin + e * cos)
            headings.append(f.heading_rad + turned)
        accept = self.rules.vertical_ft
        chance = accept.value_at(vertical) / accept.heights.max()
        q = density.value_at(horizontal) / density.area
        weight = (
            relative_speed_over_directions(first, second, climb) / (2.0 * REFERENCE_FT) / q / chance
        )
        return Pairs(
            numbers, weight, horizontal, vertical, course, attempts,
            np.array(norths), np.array(easts), np.array([f.up_ft for f in flown]),
            np.array(headings), np.array([f.speed_ft_s for f in flown]),
            np.array([f.climb_ft_s for f in flown]), np.array([c.turn_rad_s for c in commands]),
            np.array([c.acceleration_ft_s2 for c in commands]),
        )  # fmt: skip

    def _is_accepted(self, pairs: Pairs) -> BoolArray:
        return is_pair_accepted(
            self.rules, (pairs.north_ft, pairs.east_ft, pairs.up_ft), pairs.horizontal_ft,
            pairs.vertical_ft,
        )  # fmt: skip


def is_pair_accepted(
    rules: PairingRules,
    paths_ft: Sequence[FloatArray],
    horizontal_ft: FloatArray,
    vertical_ft: FloatArray,
) -> BoolArray:
    """Return which pairs start far enough apart and are closest at the wanted time and miss.

    Paths are north, east and up, each (2, seconds + 1, pairs).
    """
    north, east, up = (values[1] - values[0] for values in paths_ft)
    squared = north * north + east * east
    near = (np.abs(up[0]) < rules.start_vertical_ft) & (squared[0] < rules.start_range_ft**2)
    at = np.argmin(squared, axis=0)
    here = np.arange(squared.shape[1])
    miss = np.abs(np.sqrt(squared[at, here]) - np.abs(horizontal_ft))
    wrong = np.abs(up[at, here] - vertical_ft)
    good: BoolArray = (
        ~near
        & (at >= rules.closest_s)
        & (miss < rules.largest_horizontal_error_ft)
        & (wrong < rules.largest_vertical_error_ft)
    )
    return good


@dataclass(frozen=True)
class _Flight:
    """One aircraft's commands of sampled tracks, not yet paired, and its altitude layers' edges."""

    commands: Commands
    flies: BoolArray
    low_ft: FloatArray
    high_ft: FloatArray

    def take(self, rows: IntArray) -> "_Flight":
        commands = self.commands.take(rows)
        return _Flight(commands, self.flies[rows], self.low_ft[rows], self.high_ft[rows])


def _concatenate(parts: list[Pairs]) -> Pairs:
    names = vars(parts[0])
    return Pairs(**{n: np.concatenate([getattr(p, n) for p in parts], axis=-1) for n in names})


def draw_intruder_courses_rad(
    first: FloatArray, second: FloatArray, climb: FloatArray, drawn: FloatArray
) -> FloatArray:
    """Return the intruder's course, rad, drawn by rejection in proportion to the relative speed.

    At least 64 in 100 uniform courses are accepted, so of as many as are drawn one always is.
    """
    most = (first + second) ** 2 + climb**2
    result = np.zeros_like(first)
    left: BoolArray = np.ones(len(first), dtype=np.bool_)
    for k in range(COURSES):
        course = 2.0 * np.pi * drawn[2 * k]
        squared = first**2 + second**2 - 2.0 * first * second * np.cos(course) + climb**2
        take = left & (drawn[2 * k + 1] ** 2 * most <= squared)
        result = np.where(take, course, result)
        left &= ~take
        if not left.any():
            break
    return result


def encounter_set_of_pairs(
    pairs: Pairs, closest_s: int, reference_deg: tuple[float, float], source: str
) -> EncounterSet:
    """Return an encounter set of pairs: initial states, and events where commands change."""
    count = len(pairs.numbers)
    commands = np.stack([pairs.climb_ft_s, pairs.turn_rad_s, pairs.acceleration_ft_s2])
    # (quantity, pair, aircraft, second): rows of the file in their order.
    commands = np.ascontiguousarray(commands.transpose(0, 3, 1, 2))
    changed: AnyArray = np.ones(commands.shape[1:], dtype=np.bool_)
    changed[..., 1:] = (np.diff(commands, axis=-1) != 0.0).any(axis=0)
    # The last instant commands nothing any more.
    changed[..., -1] = False
    seconds = commands.shape[-1] - 1
    starts = np.concatenate([[0], np.cumsum(changed.reshape(2 * count, -1).sum(axis=1))])
    climb, turn, acceleration = (values[changed] for values in commands)

    def initial_values(values: FloatArray) -> FloatArray:
        return np.ascontiguousarray(values[:, 0].T).reshape(-1)

    course = np.degrees(pairs.course_rad) % 360.0
    north = pairs.north_ft[1, 0] - pairs.north_ft[0, 0]
    east = pairs.east_ft[1, 0] - pairs.east_ft[0, 0]
    bearing = np.degrees(np.arctan2(east, north) - pairs.heading_rad[0, 0]) % 360.0
    return EncounterSet(
        source,
        EVENTS,
        pairs.numbers,
        pairs.weight,
        2 * np.arange(count + 1),
        NAMES * count,
        {
            "north_m": initial_values(pairs.north_ft) * FOOT_M,
            "east_m": initial_values(pairs.east_ft) * FOOT_M,
            "altitude_m": initial_values(pairs.up_ft) * FOOT_M,
            "speed_mps": initial_values(pairs.speed_ft_s) * FOOT_M,
            "heading_rad": initial_values(pairs.heading_rad),
            "duration_s": np.full(2 * count, float(seconds)),
        },
        starts,
        {
            "time_s": np.nonzero(changed)[-1].astype(float),
            "climb_mps": climb * FOOT_M,
            "turn_rad_s": turn,
            "acceleration_mps2": acceleration * FOOT_M,
        },
        reference_deg,
        {
            "horizontal_miss_m": pairs.horizontal_ft * FOOT_M,
            "vertical_miss_m": pairs.vertical_ft * FOOT_M,
            "closest_s": np.full(count, float(closest_s)),
            "course_deg": course,
            "bearing_deg": bearing,
            "geometry": geometry_class(course),
        },
    )
