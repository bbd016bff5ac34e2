"""The tables of a study: ``summary.parquet`` and the others of its folder."""

from collections.abc import Mapping, Sequence
from typing import Any

from dsa_des.files.sealed_files import sealable_parquet
from dsa_des.results.folder import StudyFolder
from dsa_des.results.labels import AxisName, short_text
from dsa_des.results.record import FRACTION, NUMBER, StudyRecord
from dsa_des.results.rows import Rows, StoredRows
from dsa_des.results.summary import (
    Answer,
    Compared,
    Line,
    cheapest_values,
    compare_axis,
    one_sided_confidence,
    summarise,
)
from dsa_des.text.safe_text import shorten

_MOST_SCATTERS = 6
SUMMARY, DIFFERENCES, RATIOS = "summary.parquet", "differences.parquet", "ratios.parquet"
REQUIREMENTS = "requirements.parquet"
#: (Result, axis values) → the analytic answer there.
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
        self.rows = Rows(StoredRows(folder), axes, record.sample_columns)
        self.lines: list[Line] = summarise(
            self.rows, self.results, record.confidence, record.interval,
            self._analytic_answers() if expected is None else expected,
        )  # fmt: skip
        #: Of each requirement, at every combination of the other axes' values.
        self.answers: list[Answer] = [
            result
            for requirement in record.requirements
            for result in cheapest_values(requirement, self.rows.axes, self.lines)
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

    def _analytic_answers(self) -> dict[tuple[str, tuple[Any, ...]], float]:
        """Return (result, axis values) → analytic answer, from the summary in the folder."""
        table = self.folder.table(SUMMARY)
        if table is None or not {*self.rows.axes, "result", "expected"} <= set(table.column_names):
            return {}
        expected = {}
        for row in table.to_pylist():
            if isinstance(row["expected"], float):
                at = tuple(row[name] for name in self.rows.axes)
                expected[str(row["result"]), at] = row["expected"]
        return expected

    def shown_lines(self, only: Sequence[str] = ()) -> list[Line]:
        """Return the named results' lines; by default those in figures and stop rule, or all."""
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
        """Write the summary to the study's folder, and the differences, ratios and answers to
        requirements where there are any.
        """
        self.folder.write_table(SUMMARY, _parquet(self._summary_columns()))
        if self.compared:
            self.folder.write_table(DIFFERENCES, _parquet(self._difference_columns()))
        if self.ratio_lines():
            self.folder.write_table(RATIOS, _parquet(self._ratio_columns()))
        if self.answers:
            self.folder.write_table(REQUIREMENTS, _parquet(self._answer_columns()))

    def ratio_lines(self) -> list[Line]:
        """Return the lines that are ratios of events."""
        return [line for line in self.lines if line.ratio is not None]

    def _ratio_columns(self) -> dict[str, list[Any]]:
        """Return the columns of the ratio table, with gamma and bootstrap intervals for each."""
        lines = self.ratio_lines()
        columns = _axis_value_columns(self.rows.axes, lines) | _columns_at_paths(
            lines, result="result.name"
        )
        names = (
            "ratio", "unresolved", "induced", "effective_sample_size", "encounters", "clusters",
            "nominal_events", "mitigated_events", "induced_events", "nominal_probability",
            "mitigated_probability", "few", "reason", "flown", "gain",
        )  # fmt: skip
        columns |= _columns_at_paths(lines, **{name: f"ratio.{name}" for name in names})
        for method in ("gamma", "bootstrap"):
            of_method = [
                next((r for r in (line.ratio, line.other) if r and r.method == method), None)
                for line in lines
            ]
            columns |= _columns_at_paths(
                of_method,
                **{f"{method}_error": "standard_error"},
                **{f"{method}_low": "interval.0", f"{method}_high": "interval.1"},
            )
        return columns | _columns_at_paths(lines, missing="missing")

    def _summary_columns(self) -> dict[str, list[Any]]:
        return {
            **_axis_value_columns(self.rows.axes, self.lines),
            **_columns_at_paths(
                self.lines, result="result.name", value="estimate.value", low="estimate.low",
                high="estimate.high", count="estimate.count", missing="missing",
                few="estimate.few",
            ),
            "cut_off": [sum(many for _, many in line.cut_off) for line in self.lines],
            "cut_off_where": [cut_off_text(line) for line in self.lines],
            **_columns_at_paths(self.lines, expected="expected"),
        }  # fmt: skip

    def other_axis_values_text(self, answer: Answer) -> str:
        """Return the values of the other axes: ``radar.scan_rate_hz = 1, radar.latency_s = 0``."""
        names = [name for name in self.rows.axes if name != answer.requirement.axis]
        return ", ".join(f"{n} = {short_text(v)}" for n, v in zip(names, answer.at, strict=True))

    def _answer_columns(self) -> dict[str, list[Any]]:
        result = self.answers
        return {
            "requirement": [item.requirement.text() for item in result],
            "axis": [item.requirement.axis for item in result],
            "others": [self.other_axis_values_text(item) for item in result],
            "cheapest": [None if item.value is None else short_text(item.value) for item in result],
            "confidence": [one_sided_confidence(self.record.confidence)] * len(result),
            "cheapest_by_estimate": [
                None if item.estimated is None else short_text(item.estimated) for item in result
            ],
            **_columns_at_paths(
                result, value="line.estimate.value", low="line.estimate.low",
                high="line.estimate.high", few="line.estimate.few", uneven="uneven",
            ),
        }  # fmt: skip

    def _difference_columns(self) -> dict[str, list[Any]]:
        assert self.baseline is not None
        axis = self.baseline[0]
        others = [name for name in self.rows.axes if name != axis]
        return {
            **_axis_value_columns(others, self.compared),
            **_columns_at_paths(self.compared, **{axis: "value"}),
            **_columns_at_paths(
                self.compared, baseline="baseline", result="result.name",
                difference="difference.paired.value", low="difference.paired.low",
                high="difference.paired.high", unpaired_low="difference.unpaired.low",
                unpaired_high="difference.unpaired.high", pairs="difference.paired.count",
                only_baseline="difference.only_first", only_value="difference.only_second",
                ratio="ratio.ratio", ratio_low="ratio.interval.0", ratio_high="ratio.interval.1",
                unresolved="ratio.unresolved", induced="ratio.induced",
                effective_sample_size="ratio.effective_sample_size",
            ),
        }  # fmt: skip

    def names_of_scatter_results(self, only: Sequence[str] = ()) -> list[str]:
        """Return the names of results to draw as scatters: those given, or else those in figures,
        or else those that differ from the baseline.
        """
        drawn = [f.metric for f in self.record.figures if f.metric is not None]
        if only or drawn:
            numbers = {result.name for result in self.results if result.is_number}
            return [name for name in dict.fromkeys(only or drawn) if name in numbers]
        differing = [c.result for c in self.compared if c.difference.paired.half_width > 0]
        return list(dict.fromkeys(r.name for r in differing if r.kind in (NUMBER, FRACTION)))[
            :_MOST_SCATTERS
        ]


def cut_off_text(line: Line) -> str:
    """Return where a result was cut off: ``12 of 200 at the start, 3 never``; empty if nowhere."""
    texts = [f"{many:,} {shorten(where)}" for where, many in line.cut_off]
    texts[:1] = [text.replace(" ", f" of {line.runs:,} ", 1) for text in texts[:1]]
    return ", ".join(texts)


def _axis_value_columns(axes: Sequence[str], items: Sequence[Any]) -> dict[str, list[Any]]:
    """Return axis → its value in each item, from the item's `at`."""
    return {name: [item.at[k] for item in items] for k, name in enumerate(axes)}


def _columns_at_paths(items: Sequence[Any], /, **paths: str) -> dict[str, list[Any]]:
    """Return column → value at a dotted attribute path in each item; None where a step is None."""
    return {
        name: [_value_at_attribute_path(item, path) for item in items]
        for name, path in paths.items()
    }


def _value_at_attribute_path(item: Any, path: str) -> Any:
    for part in path.split("."):
        if item is not None:
            item = item[int(part)] if part.isdecimal() else getattr(item, part)
    return item


def _parquet(columns: dict[str, list[Any]]) -> bytes:
    import pyarrow as pa

    return sealable_parquet(pa.table(columns))
