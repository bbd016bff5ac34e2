"""A small encounter model of our own, and a slow reader of model files to check the fast one by."""

import itertools
from dataclasses import dataclass

import numpy as np

LABELS = ("A", "v", "\\dot v", "\\dot h", "\\dot \\psi", "L")
SIZES = (2, 3, 2, 3, 3, 2)
#: Children whose parents stand behind them in the file: the order is not topological.
INITIAL = {0: (), 1: (0, 4), 2: (3,), 3: (0, 1), 4: (), 5: (0, 1)}
#: Places: the six initial ones, then v̇, ḣ and ψ̇ at t + 1, which depend on each other.
TRANSITION = {6: (1, 2, 8), 7: (0, 3, 6, 8), 8: (4, 5)}
BOUNDARIES = ("*", "20 60 90 140", "-3 0 2", "-900 -300 450 1200", "-6 -2 1 5", "500 1500 4000")
RATES = (0.0, 0.3, 0.05, 0.125, 0.4, 0.0)


def small_model(seed: int = 7, cases: int = 4000) -> str:
    """Return a model counted over random cases; some of its transition columns are empty."""
    random = np.random.default_rng(seed)
    bins = {}
    for place in (0, 4, 1, 3, 2, 5):  # parents first
        column = column_of(INITIAL[place], SIZES, bins) if INITIAL[place] else 0
        chances = random.dirichlet(np.ones(SIZES[place]) * 2.0, 64)
        u = random.random(cases)
        edges = np.cumsum(chances, axis=1)[column + np.zeros(cases, dtype=int)]
        bins[place] = (u[:, np.newaxis] >= edges[:, :-1]).sum(axis=1)
    counts = []
    for place in range(6):
        column = column_of(INITIAL[place], SIZES, bins) + np.zeros(cases, dtype=int)
        columns = int(np.prod([SIZES[p] for p in INITIAL[place]], dtype=int))
        cells = column * SIZES[place] + bins[place]
        counts += np.bincount(cells, minlength=columns * SIZES[place]).tolist()
    sizes = (*SIZES, SIZES[2], SIZES[3], SIZES[4])
    later = []
    for place, parents in TRANSITION.items():
        columns = int(np.prod([sizes[p] for p in parents]))
        table = random.integers(0, 9, (columns, sizes[place]))
        table[random.random(columns) < 0.15] = 0
        later += table.reshape(-1).tolist()
    now = [label if k in (0, 1, 5) else f"{label}(t)" for k, label in enumerate(LABELS)]
    now += [f"{LABELS[k]}(t+1)" for k in (2, 3, 4)]
    return text_of(LABELS, INITIAL, SIZES, counts, now, TRANSITION, sizes, later)


def text_of(labels, initial, sizes, counts, now, transition, later_sizes, later) -> str:
    """Return the text of a model file."""

    def names(some):
        return ", ".join(f'"{name}"' for name in some) + " "

    def arrows(parents, count):
        rows = np.zeros((count, count), dtype=int)
        for child, some in parents.items():
            rows[list(some), child] = 1
        return "\n".join(" ".join(map(str, row)) + " " for row in rows)

    def line(some):
        return " ".join(map(str, some)) + " "

    parts = [
        ("labels_initial", names(labels)),
        ("G_initial", arrows(initial, len(labels))),
        ("r_initial", line(sizes)),
        ("N_initial", line(counts)),
        ("labels_transition", names(now)),
        ("G_transition", arrows(transition, len(now))),
        ("r_transition", line(later_sizes)),
        ("N_transition", line(later)),
        ("boundaries", "\n".join(BOUNDARIES)),
        ("resample_rates", line(RATES)),
    ]
    return "".join(f"# {name}\n{content}\n" for name, content in parts)


def column_of(parents, sizes, bins):
    """Return b1 + r1 (b2 + r2 (b3 + ...)) of the parents' bins, from the last one inwards."""
    found = 0
    for parent in reversed(parents):
        found = bins[parent] + sizes[parent] * found
    return found


@dataclass
class Slow:
    """A model file, read part by part as the format's description says."""

    labels: list[str]
    sizes: list[int]
    parents: dict[int, tuple[int, ...]]
    tables: dict[int, np.ndarray]
    now: list[str]
    later_sizes: list[int]
    later_parents: dict[int, tuple[int, ...]]
    later_tables: dict[int, np.ndarray]
    edges: list[list[float] | None]
    rates: list[float]


def slow_reading(text: str) -> Slow:
    parts = {}
    for part in text.split("#")[1:]:
        name, _, content = part.strip().partition("\n")
        parts[name.strip()] = content.strip().split("\n")

    def names(key):
        return [name.strip().strip('"') for name in parts[key][0].split(",")]

    def whole(key):
        return [int(word) for word in parts[key][0].split()]

    def tables(which, places, sizes):
        rows = [row.split() for row in parts[f"G_{which}"]]
        counts = [float(word) for word in parts[f"N_{which}"][0].split()]
        parents, found = {}, {}
        for place in places:
            parents[place] = tuple(k for k in range(len(rows)) if rows[k][place] == "1")
            columns = int(np.prod([sizes[k] for k in parents[place]], dtype=int))
            mine = [counts.pop(0) for _ in range(columns * sizes[place])]
            found[place] = np.array(mine).reshape(columns, sizes[place])
        assert not counts
        return parents, found

    labels, sizes = names("labels_initial"), whole("r_initial")
    now, later_sizes = names("labels_transition"), whole("r_transition")
    parents, first = tables("initial", range(len(labels)), sizes)
    drawn = [k for k, name in enumerate(now) if name.endswith("(t+1)")]
    later_parents, later = tables("transition", drawn, later_sizes)
    edges = [
        None if row.strip() == "*" else [float(word) for word in row.split()]
        for row in parts["boundaries"]
    ]
    rates = [float(word) for word in parts["resample_rates"][0].split()]
    return Slow(
        labels, sizes, parents, first, now, later_sizes, later_parents, later, edges, rates
    )  # fmt: skip


def marginals(slow: Slow) -> list[np.ndarray]:
    """Return the exact distribution of every initial variable, by enumerating all states."""
    found = [np.zeros(size) for size in slow.sizes]
    totals = {place: table.sum(axis=1) for place, table in slow.tables.items()}
    grid = np.indices(slow.sizes).reshape(len(slow.sizes), -1)
    chance = np.ones(grid.shape[1])
    for place, table in slow.tables.items():
        column = column_of(slow.parents[place], slow.sizes, grid) + np.zeros(len(chance), dtype=int)
        with np.errstate(invalid="ignore"):
            chance *= np.nan_to_num(table[column, grid[place]] / totals[place][column])
    for place in range(len(slow.sizes)):
        np.add.at(found[place], grid[place], chance)
    return found


def next_chances(slow: Slow, state: tuple[int, ...]) -> dict[tuple[int, ...], float]:
    """Return the exact distribution of the next state of the dynamic variables of a full state.

    A combination of parents that was never counted keeps the present bin.
    """
    drawn = list(slow.later_tables)
    base = {place: slow.now.index(slow.now[place].replace("(t+1)", "(t)")) for place in drawn}
    of = {name.removesuffix("(t)"): k for k, name in enumerate(slow.now) if "(t+1)" not in name}
    present = dict.fromkeys(range(len(slow.now)), 0)
    for label, value in zip(slow.labels, state, strict=True):
        present[of[label]] = value
    found: dict[tuple[int, ...], float] = {}
    for choice in itertools.product(*(range(slow.later_sizes[place]) for place in drawn)):
        bins = {**present, **dict(zip(drawn, choice, strict=True))}
        chance = 1.0
        for place in drawn:
            column = slow.later_tables[place][
                column_of(slow.later_parents[place], slow.later_sizes, bins)
            ]
            if column.sum() > 0:
                chance *= column[bins[place]] / column.sum()
            else:
                chance *= bins[place] == bins[base[place]]
        if chance > 0.0:
            found[choice] = chance
    return found
