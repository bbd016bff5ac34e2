"""The tables of a study: ``summary.parquet``, and what stands beside it."""

from collections.abc import Mapping, Sequence
from typing import Any

from dsa_des.results.folder import StudyFolder
from dsa_des.results.labels import AxisName, short
from dsa_des.results.record import FRACTION, NUMBER, StudyRecord
from dsa_des.results.rows import Rows, StoredRows
from dsa_des.results.sealed_files import parquet
from dsa_des.results.summary import (
    Answer,
    Compared,
    Line,
    answers,
    compare_axis,
    one_sided,
    summarise,
)
from dsa_des.text.safe_text import shortened

_MOST_SCATTERS = 6
SUMMARY, DIFFERENCES, RATIOS = "summary.parquet", "differences.parquet", "ratios.parquet"
REQUIREMENTS = "requirements.parquet"
#: (Result, place) → the analytic answer there.
Expected = Mapping[tuple[str, tuple[Any, ...]], float]


class Tables:
    """The tables of a study, from its record and its folder alone; neither scene nor block is read.

    Without the analytic answers in `expected` those stay that the folder's summary holds.
    """

    def __init__(
        self, record: StudyRecord, folder: StudyFolder, expected: Expected | None = None
    ) -> None:
        self.folder = folder
        self.record = record
        self.results = record.results
        axes = [AxisName(axis.column, axis.words) for axis in record.axes]
        self.rows = Rows(StoredRows(folder), axes, record.over)
        self.lines: list[Line] = summarise(
            self.rows, self.results, record.confidence, record.interval,
            self._earlier() if expected is None else expected,
        )  # fmt: skip
        #: What each requirement comes to, at every place of the other axes.
        self.answers: list[Answer] = [
            found
            for requirement in record.requirements
            for found in answers(requirement, self.rows.axes, self.lines)
        ]
        self.compared: list[Compared] = []
        #: The axis along which values are compared, and with which.
        self.baseline: tuple[str, Any] | None = None
        if record.compare is not None and record.compare[0] in self.rows.axes:
            axis, value = record.compare
            axis = self.rows.axes[self.rows.axes.index(axis)]  # which knows its words
            self.baseline = axis, float(value) if isinstance(value, int) else value
            self.compared = compare_axis(
                self.rows, *self.baseline, self.results, record.confidence, record.interval,
                record.compare_weight,
            )  # fmt: skip

    def _earlier(self) -> dict[tuple[str, tuple[Any, ...]], float]:
        """Return the analytic answers that the folder's summary holds."""
        table = self.folder.table(SUMMARY)
        if table is None or not {*self.rows.axes, "result", "expected"} <= set(table.column_names):
            return {}
        found = {}
        for row in table.to_pylist():
            if isinstance(row["expected"], float):
                at = tuple(row[name] for name in self.rows.axes)
                found[str(row["result"]), at] = row["expected"]
        return found

    def shown_lines(self, only: Sequence[str] = ()) -> list[Line]:
        """Return the lines of some results; by default those the study draws or waits for."""
        wanted = set(only) or {f.metric for f in self.record.figures if f.metric is not None}
        if self.record.stop_when is not None and not only:
            wanted.add(self.record.stop_when.metric)
        series = {f.metric for f in self.record.figures if f.kind == "series"} - {None}
        return [
            line
            for line in self.lines
            if not wanted
            or line.result.name in wanted
            or (not only and line.result.name.rpartition(".")[0] in series)
        ]

    def write(self) -> None:
        """Write the summary and the differences."""
        self.folder.write_table(SUMMARY, _parquet(self._summary_columns()))
        if self.compared:
            self.folder.write_table(DIFFERENCES, _parquet(self._difference_columns()))
        if self.ratios():
            self.folder.write_table(RATIOS, _parquet(self._ratio_columns()))
        if self.answers:
            self.folder.write_table(REQUIREMENTS, _parquet(self._answer_columns()))

    def ratios(self) -> list[Line]:
        """Return the lines that are ratios of events."""
        return [line for line in self.lines if line.ratio is not None]

    def _ratio_columns(self) -> dict[str, list[Any]]:
        """Return all numbers of the ratios, with both kinds of interval."""
        lines = self.ratios()
        columns: dict[str, list[Any]] = {
            name: [line.at[k] for line in lines] for k, name in enumerate(self.rows.axes)
        }
        columns["result"] = [line.result.name for line in lines]
        known = [line.ratio for line in lines if line.ratio is not None]
        for name in (
            "ratio", "unresolved", "induced", "effective_sample_size", "encounters", "clusters",
            "nominal_events", "mitigated_events", "induced_events", "nominal_probability",
            "mitigated_probability", "few", "reason",
        ):  # fmt: skip
            columns[name] = [getattr(one, name) for one in known]
        for method in ("gamma", "bootstrap"):
            both = [{r.method: r for r in (line.ratio, line.other) if r is not None}
                    for line in lines]  # fmt: skip
            found = [known.get(method) for known in both]
            columns |= {
                f"{method}_error": [None if r is None else r.standard_error for r in found],
                f"{method}_low": [None if r is None else r.interval[0] for r in found],
                f"{method}_high": [None if r is None else r.interval[1] for r in found],
            }
        columns["missing"] = [line.missing for line in lines]
        return columns

    def _summary_columns(self) -> dict[str, list[Any]]:
        columns: dict[str, list[Any]] = {
            name: [line.at[k] for line in self.lines] for k, name in enumerate(self.rows.axes)
        }
        columns |= {
            "result": [line.result.name for line in self.lines],
            "value": [line.estimate.value for line in self.lines],
            "low": [line.estimate.low for line in self.lines],
            "high": [line.estimate.high for line in self.lines],
            "count": [line.estimate.count for line in self.lines],
            "missing": [line.missing for line in self.lines],
            "few": [line.estimate.few for line in self.lines],
            "cut_off": [sum(many for _, many in line.cut_off) for line in self.lines],
            "cut_off_where": [cut_off_text(line) for line in self.lines],
            "expected": [line.expected for line in self.lines],
        }
        return columns

    def other_values(self, answer: Answer) -> str:
        """Return the values of the other axes: ``radar.scan_rate_hz = 1, radar.latency_s = 0``."""
        names = [name for name in self.rows.axes if name != answer.requirement.axis]
        return ", ".join(f"{n} = {short(v)}" for n, v in zip(names, answer.at, strict=True))

    def _answer_columns(self) -> dict[str, list[Any]]:
        found = self.answers
        return {
            "requirement": [item.requirement.text() for item in found],
            "axis": [item.requirement.axis for item in found],
            "others": [self.other_values(item) for item in found],
            "cheapest": [None if item.value is None else short(item.value) for item in found],
            "confidence": [one_sided(self.record.confidence)] * len(found),
            "cheapest_by_estimate": [
                None if item.estimated is None else short(item.estimated) for item in found
            ],
            "value": [item.line.estimate.value for item in found],
            "low": [item.line.estimate.low for item in found],
            "high": [item.line.estimate.high for item in found],
            "few": [item.line.estimate.few for item in found],
            "uneven": [item.uneven for item in found],
        }

    def _difference_columns(self) -> dict[str, list[Any]]:
        assert self.baseline is not None
        axis = self.baseline[0]
        others = [name for name in self.rows.axes if name != axis]
        items = self.compared
        columns: dict[str, list[Any]] = {
            name: [item.at[k] for item in items] for k, name in enumerate(others)
        }
        columns |= {
            axis: [item.value for item in items],
            "baseline": [item.baseline for item in items],
            "result": [item.result.name for item in items],
            "difference": [item.difference.paired.value for item in items],
            "low": [item.difference.paired.low for item in items],
            "high": [item.difference.paired.high for item in items],
            "unpaired_low": [item.difference.unpaired.low for item in items],
            "unpaired_high": [item.difference.unpaired.high for item in items],
            "pairs": [item.difference.paired.count for item in items],
            "only_baseline": [item.difference.only_first for item in items],
            "only_value": [item.difference.only_second for item in items],
        }
        ratios = [item.ratio for item in items]
        columns |= {
            "ratio": [None if r is None else r.ratio for r in ratios],
            "ratio_low": [None if r is None else r.interval[0] for r in ratios],
            "ratio_high": [None if r is None else r.interval[1] for r in ratios],
            "unresolved": [None if r is None else r.unresolved for r in ratios],
            "induced": [None if r is None else r.induced for r in ratios],
            "effective_sample_size": [
                None if r is None else r.effective_sample_size for r in ratios
            ],
        }
        return columns

    def notable_results(self, only: Sequence[str] = ()) -> list[str]:
        """Return the results worth a closer look: those named, drawn, or else that differ."""
        drawn = [f.metric for f in self.record.figures if f.metric is not None]
        if only or drawn:
            numbers = {result.name for result in self.results if result.is_number}
            return [name for name in dict.fromkeys(only or drawn) if name in numbers]
        differing = [c.result for c in self.compared if c.difference.paired.half_width > 0]
        return list(dict.fromkeys(r.name for r in differing if r.kind in (NUMBER, FRACTION)))[
            :_MOST_SCATTERS
        ]


def cut_off_text(line: Line) -> str:
    """Return ``12 of 200 at the start, 3 never``; nothing where the run cut nothing off."""
    texts = [f"{many:,} {shortened(where)}" for where, many in line.cut_off]
    texts[:1] = [text.replace(" ", f" of {line.runs:,} ", 1) for text in texts[:1]]
    return ", ".join(texts)


def _parquet(columns: dict[str, list[Any]]) -> bytes:
    import pyarrow as pa

    return parquet(pa.table(columns))
