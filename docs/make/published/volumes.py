"""How often a near mid-air collision follows, of those who come within a volume."""

from __future__ import annotations

import itertools
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from components.arguments.units import FOOT_M, NAUTICAL_MILE_M
from components.encounters.model import LAYER, LAYERS_FT, EncounterModel
from components.encounters.model_file import read_model
from components.encounters.pair_densities import PairingRules, StepDensity
from components.encounters.pairing import Pairs, PairSampler
from components.well_clear.volume import PRESETS, Volume, violation_span
from docs.make.published.rows import PublishedRow, table
from dsa_des.arrays.types import BoolArray, FloatArray
from dsa_des.results.ratio import PairedRatio, paired_ratio

TITLE = "Volumes: loss of well clear and near mid-air collisions"
ORDER = 4
MODELS = Path(__file__).parents[3] / "configs" / "encounters"
SHARED = Path(__file__).parents[4] / "shared" / "data" / "encounters" / "models"
#: MIT Lincoln Laboratory's model of aircraft that fly by sight (ATC-345).
CREWED = SHARED / "uncor_1200code_v1.txt"
UNCREWED = MODELS / "small_uncrewed.txt"
COUNT, FEWER = 100_000, 20_000
_AT_ONCE = 2000

#: P(NMAC | cylinder of 1000 ft up and down), by its radius in nmi (a gas of aircraft).
GAS = {0.5: 0.016, 1.0: 0.008, 2.0: 0.004, 3.0: 0.003}
_NMAC_FT, _HALF_FT = (500.0, 100.0), 1000.0


def _density(edges: list[float], heights: list[float]) -> StepDensity:
    return StepDensity(np.array(edges), np.array(heights))


#: Every miss distance of the box alike: no draw is preferred.
EVEN = PairingRules(
    vertical_ft=_density([-1500.0, 1500.0], [1.0]),
    horizontal_ft=_density([-18240.0, 18240.0], [1.0 / 36480.0]),
)


@dataclass(frozen=True)
class Sample:
    """Encounters that nobody mitigates: what each weighs, and which volumes it violates."""

    weight: FloatArray
    violated: dict[str, BoolArray]
    #: Relative speed over ground and up at the closest approach, ft/s.
    level_ft_s: FloatArray
    climb_ft_s: FloatArray
    #: Difference in height there, ft.
    apart_ft: FloatArray

    def share(self, of: str, within: str) -> PairedRatio:
        """Return the share of those within a volume that are within another one, too."""
        both = self.violated[of] & self.violated[within]
        return paired_ratio(self.violated[within], both, self.weight)


def sampled(
    own: Path,
    intruder: Path,
    count: int,
    volumes: dict[str, Volume],
    rules: PairingRules | None = None,
    seed: int = 0,
) -> Sample:
    """Return encounters of two models by number, and what they violate on straight seconds."""
    used = PairingRules() if rules is None else rules
    sampler = PairSampler(read_model(own), read_model(intruder), seed, used)
    parts = []
    for start in range(0, count, _AT_ONCE):
        pairs = sampler.sample_pairs(range(start, min(start + _AT_ONCE, count)))
        violated = {name: violates(volume, pairs) for name, volume in volumes.items()}
        steps = [np.diff(getattr(pairs, f"{axis}_ft")[1] - getattr(pairs, f"{axis}_ft")[0], axis=0)
                 [used.closest_s] for axis in ("north", "east", "up")]  # fmt: skip
        level_ft_s, climb_ft_s = np.hypot(steps[0], steps[1]), np.abs(steps[2])
        parts.append((pairs.weight, violated, level_ft_s, climb_ft_s, np.abs(pairs.vertical_ft)))
    weights, flags, level, climb, apart = zip(*parts, strict=True)
    return Sample(
        np.concatenate(weights),
        {name: np.concatenate([one[name] for one in flags]) for name in volumes},
        np.concatenate(level),
        np.concatenate(climb),
        np.concatenate(apart),
    )


def violates(volume: Volume, pairs: Pairs) -> BoolArray:
    """Return which pairs violate a volume at any time; between seconds they fly straight."""
    apart = [
        (getattr(pairs, f"{axis}_ft")[0] - getattr(pairs, f"{axis}_ft")[1]) * FOOT_M
        for axis in ("east", "north", "up")
    ]
    at = [one[:-1] for one in apart]
    rate = [np.diff(one, axis=0) for one in apart]
    # Who is farther apart in height through all of a second is not in it.
    second, pair = np.nonzero(np.abs(at[2]) - np.abs(rate[2]) <= volume.vertical_m)
    relative = [one[second, pair] for one in (*at, *rate)]
    begin_s = violation_span(volume, relative, 0.0, 1.0).begin_s
    found = np.zeros(len(pairs.weight), dtype=bool)
    found[pair[begin_s < np.inf]] = True
    return found


def gas_share(radius_ft: float, level_ft_s: float, climb_ft_s: float) -> float:
    """Return P(NMAC | cylinder) of a gas: the flows into both, by mean relative speeds."""

    def flow(r: float, half: float) -> float:
        return 4.0 * r * half * level_ft_s + np.pi * r**2 * climb_ft_s

    return float(flow(*_NMAC_FT) / flow(radius_ft, _HALF_FT))


def altitude_edges_ft(model: EncounterModel) -> FloatArray:
    """Return where a model's layers of altitude begin and end."""
    edges = model.bins[model.labels.index(LAYER)].edges
    return np.array(LAYERS_FT) if edges is None else edges


def height_share(model: EncounterModel, layer_ft: tuple[float, float]) -> float:
    """Return of the aircraft within 1000 ft of a level ownship's height the share within 100 ft.

    By the counts of the model's file alone: altitudes are uniform in its layers, and the ownship's
    in the layer that is given.
    """
    node = model.initial.nodes[model.labels.index(LAYER)]
    edges_ft = altitude_edges_ft(model)
    below = np.concatenate([[0.0], np.cumsum(node.counts.sum(axis=0))])
    own_ft = np.linspace(*layer_ft, 20_001)
    near, far = (
        np.interp(own_ft + half, edges_ft, below) - np.interp(own_ft - half, edges_ft, below)
        for half in (_NMAC_FT[1], _HALF_FT)
    )
    return float(near.sum() / far.sum())


def layers(model: EncounterModel) -> str:
    """Return the table of P(NMAC | cylinder) of level flights by the ownship's layer."""
    lines = [
        f"| level flights, ownship at | within 100 ft | {' | '.join(CYLINDERS)} |",
        "|---|---|" + "---|" * len(CYLINDERS),
    ]
    for low, high in itertools.pairwise(altitude_edges_ft(model)):
        share = height_share(model, (low, high))
        cells = [
            f"{_NMAC_FT[0] * FOOT_M / (radius * NAUTICAL_MILE_M) * share:.4f}" for radius in GAS
        ]
        lines.append(
            f"| {low:.0f} to {high:.0f} ft | {100.0 * share:.1f} % | {' | '.join(cells)} |"
        )
    return "\n".join(lines)


def uncrewed_at(folder: Path, speeds_kt: str = "30 60", layer_ft: str = "1200 3000") -> Path:
    """Write the model of an uncrewed aircraft with other speeds, or in another layer."""
    text = UNCREWED.read_text(encoding="utf-8")
    text = text.replace("\n1200 3000\n30 60\n", f"\n{layer_ft}\n{speeds_kt}\n")
    path = folder / f"uncrewed {speeds_kt} {layer_ft}.txt"
    path.write_text(text, encoding="utf-8")
    return path


_TEXT = """
**Loss of well clear.** Weinert, Campbell, Vela, Schuldt and Kurucar (*Well-clear recommendation
for small unmanned aircraft systems based on unmitigated collision risk*, Journal of Air
Transportation, 2018) chose 2000 ft by 250 ft so that about one in ten losses is a near mid-air
collision (NMAC, 500 ft by 100 ft). Ours: an uncrewed ownship that flies straight and level at 30
to 60 kt, 1200 to 3000 ft above ground (`configs/encounters/small_uncrewed.txt`, made up), meets
aircraft of MIT Lincoln Laboratory's uncorrelated model (`uncor_1200code_v1`, BSD-2, not part of
the project); neither aircraft gives way; {count:,} weighted encounters of `dsa-des encounters`'
pairing, volumes exact between seconds; intervals of 95 % (gamma).

{losses}

*About* is taken as within 0.005. For the other volumes we know of no published values:
{others} Dependence on assumptions ({fewer:,} encounters
a row):

{variants}

For a gas of level flights the number is geometry alone, (500 · 100) / (2000 · 250) = 0.1; climbs
add entries through top and bottom, the more the flatter the volume is.

**Cylinders.** The same for cylinders of 1000 ft up and down, of the same {count:,} encounters:

{cylinders}

Published for a gas of aircraft. A gas gives, from the flows into both volumes with the mean
relative speeds at the closest approach, of {level:.0f} ft/s over ground and {climb:.1f} ft/s up:

{gas}

Level flights alone would give r h / (R H): 0.0165, 0.0082, 0.0041, 0.0027. In a gas all
differences of height are equally likely, so of those within 1000 ft a tenth are within 100 ft.
For aircraft that an ownship at 1200 to 3000 ft meets they are not. By the counts of altitudes in
the model's file, and times 500 ft over the radius:

{layers}

Of the encounters that are flown above {near:.1f} % are within 100 ft at the closest approach:
they are weighted by relative speed and climb until then. Climbs account for the rest, as entries
through top and bottom. So rows are outside because of the distribution of altitudes, not of the
counting of volumes. Not open: the model and the ownship of the published numbers.
"""
VOLUMES = {
    "nmac": PRESETS["nmac"],
    "2000 ft by 250 ft": PRESETS["astm_f3442"],
    "DO-365 (35 s, 4000 ft, 450 ft)": Volume(4000 * FOOT_M, 450 * FOOT_M, 35.0),
    "DO-365, non-cooperative (2200 ft, 450 ft)": PRESETS["do365_non_cooperative"],
}
CYLINDERS = {
    f"{radius:g} nmi": Volume(radius * NAUTICAL_MILE_M, _HALF_FT * FOOT_M) for radius in GAS
}
#: What the table of dependences shows, of these.
_SHOWN = ("2000 ft by 250 ft", "DO-365 (35 s, 4000 ft, 450 ft)", "0.5 nmi")


def variants(intruder: Path, count: int) -> str:
    """Return the table of what P(NMAC | loss of well clear) depends on."""
    every = {**VOLUMES, **CYLINDERS}
    volumes = {name: every[name] for name in ("nmac", *_SHOWN)}
    lines = [
        "| P(NMAC given a loss) | of 2000 ft by 250 ft | losses | of DO-365 (35 s) | of 0.5 nmi |",
        "|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases: list[tuple[str, Path, Path, PairingRules | None]] = [
            (f"ownship at {kt.replace(' ', ' to ')} kt", uncrewed_at(folder, kt), intruder, None)
            for kt in ("20 30", "30 60", "80 120")
        ]
        cases += [
            (f"between {ft.replace(' ', ' and ')} ft", uncrewed_at(folder, layer_ft=ft), intruder,
             None)
            for ft in ("500 1200", "3000 5000", "5000 18000")
        ]  # fmt: skip
        cases += [
            ("every miss distance drawn alike, to 3 nmi and 1500 ft", UNCREWED, intruder, EVEN),
            ("two crewed aircraft of the model", intruder, intruder, None),
            ("our made-up light aircraft", UNCREWED, MODELS / "light_aircraft.txt", None),
        ]
        for what, own, other, rules in cases:
            found = sampled(own, other, count, volumes, rules)
            shown = [_shown(found.share("nmac", name)) for name in _SHOWN]
            shown.insert(1, f"{int(found.violated[_SHOWN[0]].sum()):,}")
            lines.append(f"| {' | '.join([what, *shown])} |")
    return "\n".join(lines)


def _shown(share: PairedRatio, digits: int = 3) -> str:
    low, high = share.interval
    return f"{share.ratio:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def section(images: Path) -> str:
    """Sample the encounters and return the section."""
    found = sampled(UNCREWED, CREWED, COUNT, {**VOLUMES, **CYLINDERS})
    share = found.share("nmac", "2000 ft by 250 ft")
    row = PublishedRow("P(NMAC given loss of 2000 ft by 250 ft)", 0.1, share.ratio, within=0.005,
                       interval=share.interval)  # fmt: skip
    others = " ".join(
        f"{name} {_shown(found.share('nmac', name), 4)}." for name in list(VOLUMES)[2:]
    )
    cylinders = [
        PublishedRow(f"P(NMAC given a cylinder of {name})", published, share.ratio, within=0.001,
                     interval=share.interval, digits=4)
        for (name, published), share in zip(
            ((f"{radius:g} nmi", published) for radius, published in GAS.items()),
            (found.share("nmac", name) for name in CYLINDERS), strict=True,
        )
    ]  # fmt: skip
    level = float(np.average(found.level_ft_s, weights=found.weight))
    climb = float(np.average(found.climb_ft_s, weights=found.weight))
    inside = found.apart_ft < _HALF_FT
    near = float(np.average(found.apart_ft[inside] < _NMAC_FT[1], weights=found.weight[inside]))
    gas = [
        PublishedRow(f"of a gas: a cylinder of {radius:g} nmi", published,
                     gas_share(radius * NAUTICAL_MILE_M / FOOT_M, level, climb), within=0.001,
                     digits=4)
        for radius, published in GAS.items()
    ]  # fmt: skip
    return _TEXT.format(
        count=COUNT, fewer=FEWER, losses=table([row]), others=others,
        variants=variants(CREWED, FEWER),
        layers=layers(read_model(CREWED)), near=100.0 * near, level=level, climb=climb,
        gas=table(gas), cylinders=table(cylinders),
    )  # fmt: skip
