"""The rows of a study's parts, read part by part, and how they fall into places and units.

A *place* is a combination of values of the summary's axes. Where a study runs over a sample of
encounters (`over`), the encounters are the independent units and a place of the summary joins all
of them; otherwise the replicas are.
"""

from collections import Counter, OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.results.differences import (
    EstimatedDifference,
    RatioTerms,
    estimate_difference,
    paired_unit_means,
    quantile_difference,
    ratio_as_estimate,
    ratio_difference,
)
from dsa_des.results.folder import StudyFolder
from dsa_des.results.ratio import (
    PairedRatio,
    paired_ratio,
    redistribute_lost_runs,
    share_from_flown_sample,
)
from dsa_des.results.record import (
    CRASHED,
    EVENT,
    FRACTION,
    RATIO,
    SHARE,
    STANDS_FOR,
    TRIALS,
    Result,
    geometry_column,
    predicted_column,
)
from dsa_des.results.statistics import (
    Estimate,
    estimate_bounded_mean,
    estimate_mean,
    estimate_quantile,
    estimate_rare_probability,
    estimate_share,
)

if TYPE_CHECKING:
    import pyarrow as pa


#: Bytes of columns that are held at a time; a study of more rows than that holds at least one.
_MOST_HELD_BYTES = 2**27
#: Rows without result that are listed, the first ones.
MOST_FAILED = 50
_PLACE = ("cell", "replica")
#: Columns that stand in no statistics.
_ABOUT = ("status", "error", "command")
#: Sets that are drawn for a bootstrap interval of a ratio.
_RESAMPLES = 2000


class StoredRows:
    """The rows with a result, sorted by cell and replica, and how many other runs failed and how.

    With `before_round` only those of earlier rounds.
    """

    def __init__(self, folder: StudyFolder, before_round: int | None = None) -> None:
        self._folder, self._before_round = folder, before_round
        schema = folder.record.schema_of_parts()
        self.names = [field.name for field in schema if field.name not in _ABOUT]
        #: Status → how many runs ended in it.
        self.status: Counter[str] = Counter()
        #: The first rows without result, and the first row of all, as column → value.
        self.failed: list[dict[str, Any]] = []
        self.first: dict[str, Any] = {}
        #: Of a sample: by cell, for how many those without result were to stand; NaN: unknown.
        self.unheard: dict[int, list[float]] = {}
        self._order: IntArray | None = None
        self._held: OrderedDict[str, AnyArray] = OrderedDict()
        rows = max(1, folder.record.cells * folder.record.replicas)
        self._at_once = max(3, _MOST_HELD_BYTES // (8 * rows))
        others = [name for name in self.names if name not in _PLACE]
        self._read_columns([*_PLACE, *others[: self._at_once - len(_PLACE)]], look=True)

    def __len__(self) -> int:
        return self._count

    def column(self, name: str) -> AnyArray:
        """Return a column's values in rows with a result; missing numbers are NaN, texts None."""
        if name not in self._held:
            index = self.names.index(name)
            others = [n for n in self.names[index:] if n not in self._held]
            self._read_columns(others[: self._at_once], look=False)
        self._held.move_to_end(name)
        return self._held[name]

    def _read_columns(self, names: Sequence[str], *, look: bool) -> None:
        """Read and keep named columns; with `look`, also count statuses and keep first failures."""
        while self._held and len(self._held) + len(names) > self._at_once:
            self._held.popitem(last=False)
        columns = None if look else [*names, "error"]
        pieces: dict[str, list[Any]] = {name: [] for name in names}
        for table in self._folder.each_part(self._before_round, columns):
            good = np.asarray(table["error"].is_null())
            if look:
                self._note_statuses_and_failed_rows(table, good)
            kept = table if good.all() else table.filter(good)
            for name, result in pieces.items():
                result.append(_to_numpy_or_encoded_texts(kept[name].combine_chunks()))
        if look:
            cell, replica = (_concatenate(pieces[name]) for name in _PLACE)
            self._count = len(cell)
            later = (np.diff(cell) > 0) | ((np.diff(cell) == 0) & (np.diff(replica) > 0))
            self._order = None if later.all() else np.lexsort((replica, cell))
        for name in names:
            column = _concatenate(pieces.pop(name))
            self._held[name] = column if self._order is None else column[self._order]

    def _note_statuses_and_failed_rows(self, table: "pa.Table", good: BoolArray) -> None:
        self.status.update(table["status"].to_pylist())
        places = table.select(_PLACE).to_pydict()
        least = min(range(table.num_rows), key=lambda k: tuple(places[name][k] for name in _PLACE))
        self.first = min(
            (row for row in (self.first, table.slice(least, 1).to_pylist()[0]) if row),
            key=_cell_and_replica,
        )
        if not good.all():
            if STANDS_FOR in table.column_names:
                others = table.filter(~good).select(["cell", STANDS_FOR]).to_pydict()
                for cell, many in zip(others["cell"], others[STANDS_FOR], strict=True):
                    self.unheard.setdefault(cell, []).append(np.nan if many is None else many)
            bad = table.filter(~good).slice(0, MOST_FAILED).to_pylist()
            self.failed = sorted([*self.failed, *bad], key=_cell_and_replica)[:MOST_FAILED]


def _cell_and_replica(row: dict[str, Any]) -> tuple[int, int]:
    return row["cell"], row["replica"]


def _to_numpy_or_encoded_texts(values: "pa.Array") -> Any:
    """Return numbers as a NumPy array, and texts as a dictionary-encoded Arrow array."""
    import pyarrow as pa

    if pa.types.is_string(values.type):
        return values.dictionary_encode()
    return values.to_numpy(zero_copy_only=False)


def _concatenate(pieces: list[Any]) -> AnyArray:
    import pyarrow as pa

    if isinstance(pieces[0], np.ndarray):
        return np.concatenate(pieces)
    whole = pa.chunked_array(pieces).unify_dictionaries().combine_chunks()
    texts = np.array([*whole.dictionary.to_pylist(), None], dtype=object)
    joined: AnyArray = texts[whole.indices.fill_null(len(texts) - 1).to_numpy()]
    return joined


class Rows:
    """A study's rows as columns, in places (axis values) and units (replicas or encounters)."""

    def __init__(self, stored: StoredRows, axes: Sequence[str], over: Sequence[str]) -> None:
        self.stored = stored
        self.failed = stored.status.total() - len(stored)
        #: Those of the failed whose process died; they are tried again.
        self.crashed = stored.status[CRASHED]
        self.axes = [name for name in axes if name not in over]
        self.over = list(over)
        #: What rows share that belong to the same place, and to the same independent unit.
        self.places = self._value_combination_codes(self.axes)
        self.units = self._value_combination_codes(self.over if self.over else ["replica"])

    @cached_property
    def run_codes(self) -> IntArray:
        """Code of each row's run: equal for rows of the same replica of the same unit."""
        replica: IntArray = self.column("replica")
        return self.units * (int(replica.max(initial=0)) + 1) + replica

    def column(self, name: str) -> AnyArray:
        """Return the values of a column in all rows; missing numbers are NaN."""
        return self.stored.column(name)

    @cached_property
    def represented_run_counts(self) -> FloatArray | None:
        """Runs each row stands for in a flown sample, 0 if not flown; None if all are flown."""
        if STANDS_FOR not in self.stored.names:
            return None
        result = self.column(STANDS_FOR)
        for cell, lost in self.stored.unheard.items():
            result = redistribute_lost_runs(result, lost, self.column("cell") == cell)
        return result

    def predicted_events(self, event: str, rows: IntArray) -> FloatArray | None:
        """Return what was predicted for an event in the rows before flight; None if nothing was."""
        name = geometry_column(predicted_column(event))
        return np.nan_to_num(self.column(name)[rows]) if name in self.stored.names else None

    def is_missing_unless_flown(self, name: str) -> bool:
        """Return whether runs that were not flown lack a value in this column."""
        if self.represented_run_counts is None:
            return False
        values = self.column(name)[self.represented_run_counts == 0.0]
        return values.dtype != object and bool(np.isnan(values.astype(float)).any())

    def row(self, number: int) -> dict[str, Any]:
        """Return a row as column → value."""
        return {
            name: _numpy_scalar_to_python(self.column(name)[number]) for name in self.stored.names
        }

    def _value_combination_codes(self, names: Sequence[str]) -> IntArray:
        codes = np.zeros(len(self.stored), dtype=np.int64)
        for name in names:
            _, code = np.unique(self.column(name), return_inverse=True)
            codes = codes * (int(code.max(initial=0)) + 1) + code
        return codes

    def row_indices_by_axis_values(self) -> Iterator[tuple[tuple[Any, ...], IntArray]]:
        """Yield (axis values, indices of their rows), combinations in order of first row."""
        order = np.argsort(self.places, kind="stable")
        _, starts = np.unique(self.places[order], return_index=True)
        groups = np.split(order, starts[1:]) if len(order) else []
        for rows in sorted(groups, key=lambda rows: int(rows[0])):
            at = tuple(_numpy_scalar_to_python(self.column(name)[rows[0]]) for name in self.axes)
            yield at, rows

    def comparisons_with_baseline(
        self, axis: str, baseline: Any
    ) -> Iterator[tuple[Any, tuple[Any, ...], IntArray, IntArray]]:
        """Yield combinations of axis values off `axis`'s baseline with a counterpart at it.

        Its value of the axis, those of the others, the rows at the baseline and its own.
        """
        column = self.axes.index(axis)
        places = dict(self.row_indices_by_axis_values())
        for at, rows in places.items():
            base = places.get((*at[:column], baseline, *at[column + 1 :]))
            if at[column] != baseline and base is not None:
                yield at[column], (*at[:column], *at[column + 1 :]), base, rows

    def mean_by_unit(self, name: str, rows: IntArray) -> tuple[IntArray, FloatArray]:
        """Return the units in some rows and each one's mean value (over its replicas)."""
        values = self.column(name)[rows].astype(float)
        known = ~np.isnan(values)
        units, index = np.unique(self.units[rows], return_inverse=True)
        total = np.bincount(index[known], weights=values[known], minlength=len(units))
        many = np.bincount(index[known], minlength=len(units))
        with np.errstate(invalid="ignore", divide="ignore"):
            return units, np.where(many > 0, total / many, np.nan)

    def estimate(
        self, result: Result, rows: IntArray, confidence: float, method: str
    ) -> tuple[Estimate, int]:
        """Return (estimate of a result, number of rows without a value) over the given rows."""
        if result.kind == RATIO:
            ratio, missing = self.ratio(result, rows, confidence, method)
            return ratio_as_estimate(ratio), missing
        if self.is_missing_unless_flown(result.name):
            return self._sampled_share_and_missing_count(result, rows, confidence)
        values = self.column(result.name)[rows].astype(float)
        missing = int(np.isnan(values).sum())
        if result.kind not in (EVENT, SHARE):
            _, of_units = self.mean_by_unit(result.name, rows)
            if result.quantile is not None:
                return estimate_quantile(of_units, result.quantile, confidence), missing
            if result.kind == FRACTION:
                return estimate_bounded_mean(of_units, confidence), missing
            if result.unseen is not None:
                more = self.mean_by_unit(result.unseen, rows)[1]
                return estimate_rare_probability(of_units, more, confidence), missing
            return estimate_mean(of_units, confidence, method), missing
        trials = np.ones(len(rows))
        if result.kind == SHARE:
            trials = np.nan_to_num(self.column(result.name + TRIALS)[rows].astype(float))
        trials = np.where(np.isnan(values), 0.0, trials)
        units, index = np.unique(self.units[rows], return_inverse=True)
        won = np.bincount(index, weights=np.nan_to_num(values) * trials, minlength=len(units))
        tried = np.bincount(index, weights=trials, minlength=len(units))
        return estimate_share(won.astype(float), tried.astype(float), confidence), missing

    def _sampled_share_and_missing_count(
        self, result: Result, rows: IntArray, confidence: float
    ) -> tuple[Estimate, int]:
        """Return (share of runs with an event, rows without a value) from a flown sample."""
        assert self.represented_run_counts is not None
        values, stands_for = (
            self.column(result.name)[rows].astype(float),
            self.represented_run_counts[rows],
        )
        known = ~np.isnan(values) | (stands_for == 0.0)
        ratio = share_from_flown_sample(
            np.ones(int(known.sum())), values[known], np.ones(int(known.sum())),
            stands_for[known], cluster=self.units[rows][known],
            predicted=self.predicted_events(result.name, rows[known]), confidence=confidence,
        )  # fmt: skip
        return ratio_as_estimate(ratio), int((~known).sum())

    def ratio(
        self, result: Result, rows: IntArray, confidence: float, method: str
    ) -> tuple[PairedRatio, int]:
        """Return (ratio, number of rows without a value) over the given rows.

        Runs of the same encounter, and of the same unit, hang together.
        """
        terms, used, missing = self._ratio_terms(result, rows)
        below, above, weight, cluster, stands_for, predicted = terms
        method = "bootstrap" if method == "bootstrap" else "gamma"
        together = cluster if len(np.unique(cluster)) < len(used) else None
        options: dict[str, Any] = {
            "cluster": together, "predicted": predicted, "confidence": confidence,
            "method": method, "resamples": _RESAMPLES,
        }  # fmt: skip
        is_share = result.ratio is not None and result.ratio.share
        if is_share and stands_for is not None:
            return share_from_flown_sample(below, above, weight, stands_for, **options), missing
        ratio = paired_ratio(below, above, weight, stands_for=stands_for, **options)
        if is_share:
            low, high = ratio.interval
            ratio = replace(ratio, interval=(low, min(high, 1.0)))
        return ratio, missing

    def _ratio_terms(self, result: Result, rows: IntArray) -> tuple[RatioTerms, IntArray, int]:
        """Return (a ratio's columns in the rows with all, those rows, the number of others)."""
        of = result.ratio
        assert of is not None
        if of.only is not None:
            rows = rows[self.column(of.only[0])[rows] == of.only[1]]
        below, above = (self.column(name)[rows].astype(float) for name in (of.below, of.above))
        weight = np.ones(len(rows))
        if of.weight is not None:
            weight = self.column(of.weight)[rows].astype(float)
        units = self.units[rows]
        cluster = units if of.cluster is None else self.column(of.cluster)[rows]
        stands_for = (
            None if self.represented_run_counts is None else self.represented_run_counts[rows]
        )
        flown = np.ones(len(rows), dtype=bool) if stands_for is None else stands_for > 0.0
        known = ~(np.isnan(below) | (flown & np.isnan(above)) | np.isnan(weight))
        if of.cluster is not None:
            known &= ~np.isnan(cluster.astype(float))
            if self.over:  # one encounter's number means another in another file
                _, number = np.unique(cluster, return_inverse=True)
                cluster = units * (int(number.max(initial=0)) + 1) + number
        predicted = self.predicted_events(of.above, rows)
        terms = RatioTerms(below, above, weight, cluster, stands_for, predicted).select_runs(known)
        return terms, rows[known], int((~known).sum())

    def pair_rows_by_run(self, first: IntArray, second: IntArray) -> tuple[IntArray, IntArray]:
        """Return rows of `first` and rows of `second` that belong to the same runs, in pairs."""
        runs = self.run_codes
        _, here, there = np.intersect1d(runs[first], runs[second], return_indices=True)
        return first[here], second[there]

    def paired_means_by_unit(
        self, name: str, first: IntArray, second: IntArray
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return (units, values in `first`, values in `second`): unit means over common runs."""
        values, (one, two) = self.column(name), self.pair_rows_by_run(first, second)
        return paired_unit_means(
            self.units[one], values[one].astype(float), values[two].astype(float)
        )

    def difference(
        self, result: Result, first: IntArray, second: IntArray, confidence: float, method: str
    ) -> EstimatedDifference:
        """Return a result's difference, `second` minus `first`, over runs that both have."""
        if result.kind == RATIO:
            return self._ratio_difference(result, first, second, confidence)
        _, one, two = self.paired_means_by_unit(result.name, first, second)
        if result.quantile is not None:
            return quantile_difference(one, two, result.quantile, confidence)
        return estimate_difference(one, two, confidence, method, kind=result.kind)

    def _ratio_difference(
        self, result: Result, first: IntArray, second: IntArray, confidence: float
    ) -> EstimatedDifference:
        (one, mine, _), (two, other, _) = (
            self._ratio_terms(result, rows) for rows in (first, second)
        )
        _, here, there = np.intersect1d(
            self.run_codes[mine], self.run_codes[other], return_indices=True
        )
        alone = len(mine) - len(here), len(other) - len(there)
        return ratio_difference(one.select_runs(here), two.select_runs(there), alone, confidence)

    def cut_off_counts(self, result: Result, rows: IntArray) -> tuple[tuple[str, int], ...]:
        """Return sorted (where in the run the result was cut off, number of such rows)."""
        if result.cut_off is None:
            return ()
        said = [where for where in self.column(result.cut_off)[rows].tolist() if where is not None]
        return tuple(sorted(Counter(said).items()))


def _numpy_scalar_to_python(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value
