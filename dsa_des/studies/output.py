"""Results beside a study's parts: ``summary.parquet``, ``differences.parquet``, figures."""

import hashlib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dsa_des.arrays.types import FloatArray
from dsa_des.errors import SceneError, UsageError
from dsa_des.replicas.changed_scene import scene_of
from dsa_des.studies.cheapest import Answer, answers, one_sided
from dsa_des.studies.distribution_figures import draw_cdf, draw_histogram
from dsa_des.studies.figures import SummaryPlaces, draw_axis, draw_heat, draw_polar, draw_scatter
from dsa_des.studies.folder import StudyFolder
from dsa_des.studies.identity import record_of
from dsa_des.studies.labels import short, value_label
from dsa_des.studies.map_figure import draw_map
from dsa_des.studies.metric import FRACTION, NUMBER
from dsa_des.studies.record import FigureRecord, StudyRecord
from dsa_des.studies.requirements import Requirement
from dsa_des.studies.seal import parquet
from dsa_des.studies.series_figure import draw_series, of_series
from dsa_des.studies.stored_rows import StoredRows
from dsa_des.studies.study import Study
from dsa_des.studies.summary import Compared, Line, Rows, compare_axis, paired, summarise
from dsa_des.text.safe_text import shortened

#: Replicas whose random draws an analytic answer is averaged over.
_EXPECTED_OVER = 64
_MOST_SCATTERS = 6
#: Bytes of a file's name, with room for what is put around it while it is written.
_LONGEST_NAME = 200
#: Letters of a figure's title.
_LONGEST_TITLE = 200
SUMMARY, DIFFERENCES, RATIOS = "summary.parquet", "differences.parquet", "ratios.parquet"
REQUIREMENTS = "requirements.parquet"


class Tables:
    """The tables of a study.

    Parameters
    ----------
    study : Study or StudyRecord
        A record tells how to read the tables and nothing else: with it no scene is read.
    folder : StudyFolder
        With results.
    """

    def __init__(self, study: Study | StudyRecord, folder: StudyFolder) -> None:
        self.folder = folder
        self.study = study if isinstance(study, Study) else None
        self.record = record_of(study) if isinstance(study, Study) else study
        record = self.record
        self.results = record.results_list()
        axes = [axis.column for axis in record.axes]
        self.rows = Rows(StoredRows(folder), axes, record.over)
        expected = self._earlier() if self.study is None else self._expected(self.study)
        self.lines: list[Line] = summarise(
            self.rows, self.results, record.confidence, record.interval, expected
        )
        wanted = [Requirement(**vars(item)) for item in record.requirements]
        #: What each requirement comes to, at every place of the other axes.
        self.answers: list[Answer] = [
            found for one in wanted for found in answers(one, self.rows.axes, self.lines)
        ]
        self.compared: list[Compared] = []
        #: The axis along which values are compared, and with which.
        self.baseline: tuple[str, Any] | None = None
        if record.compare is not None and record.compare[0] in self.rows.axes:
            axis, value = record.compare
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

    def _expected(self, study: Study) -> dict[tuple[str, tuple[Any, ...]], float]:
        """Return the analytic answers at every place, averaged over draws and encounters."""
        sums: dict[tuple[str, tuple[Any, ...]], list[float]] = {}
        many = min(study.replicas, _EXPECTED_OVER) if study.draws else 1
        for cell in range(len(study.cells)):
            labels = study.labels(cell)
            at = tuple(
                float(labels[axis.column]) if axis.numeric else str(labels[axis.column])
                for axis in study.axes
                if axis.column in self.rows.axes
            )
            try:
                scene = study.scene(cell)
                metrics = [spec.build(scene) for spec in study.metrics]
                for number in range(many):
                    own = scene_of(scene, study.replica(number, cell))
                    for metric in metrics:
                        for name, value in metric.expected(own).items():
                            sums.setdefault((name, at), []).append(value)
            except (SceneError, ValueError):
                continue
            if not sums:  # no metric of this study knows any
                return {}
        return {key: sum(values) / len(values) for key, values in sums.items()}

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
        told = [line.ratio for line in lines if line.ratio is not None]
        for name in (
            "ratio", "unresolved", "induced", "effective_sample_size", "encounters", "clusters",
            "nominal_events", "mitigated_events", "induced_events", "nominal_probability",
            "mitigated_probability", "few", "reason",
        ):  # fmt: skip
            columns[name] = [getattr(one, name) for one in told]
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

    def others_said(self, answer: Answer) -> str:
        """Return the values of the other axes: ``radar.scan_rate_hz = 1, radar.latency_s = 0``."""
        names = [name for name in self.rows.axes if name != answer.requirement.axis]
        return ", ".join(f"{n} = {short(v)}" for n, v in zip(names, answer.at, strict=True))

    def _answer_columns(self) -> dict[str, list[Any]]:
        found = self.answers
        return {
            "requirement": [item.requirement.said() for item in found],
            "axis": [item.requirement.axis for item in found],
            "others": [self.others_said(item) for item in found],
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

    def draw(self, only: Sequence[str] = ()) -> list[Path]:
        """Draw the study's figures and return their paths.

        `only` names the results whose conditions are drawn against each other where there is a
        swap; by default those that the figures show, or the first ones.
        """
        paths: list[Path] = []
        for number, figure in enumerate(self.record.figures):
            if figure.kind == "run":
                paths += self._draw_run(figure.cell, figure.replica)
                continue
            drawn = io.BytesIO()
            if self._draw_one(drawn, figure):
                paths.append(self._write(f"figure-{number + 1:02d}-{figure.kind}.png", drawn))
        if self.compared and self.baseline is not None:
            paths += self._draw_scatters(*self.baseline, only)
        return paths

    def _write(self, name: str, drawn: io.BytesIO) -> Path:
        self.folder.write_file(name, drawn.getvalue())
        return self.folder.path / name

    def _draw_one(self, target: BinaryIO, figure: FigureRecord) -> bool:
        if figure.kind in ("histogram", "cdf"):
            return self._draw_spread(target, figure)
        if figure.kind == "series":
            return self._draw_series(target, figure)
        categories = {axis.column for axis in self.record.axes if axis.category}
        places = SummaryPlaces(self.rows.axes, self.lines, categories)
        shown = (figure.axis, figure.x, figure.y)
        if not places.axes or any(name not in places.axes for name in shown if name is not None):
            return False
        metric = str(figure.metric)
        title = _shortened(self.record.title if figure.title is None else figure.title)
        axis = figure.axis or places.axes[0]
        if figure.kind in ("heat", "map"):
            x = figure.x or places.axes[0]
            y = figure.y or next((a for a in places.axes if a != x), x)
            if x == y:
                return False
            if figure.kind == "heat":
                draw_heat(target, places, metric, x, y, title)
            else:
                draw_map(target, places, metric, x, y, figure.limits, title, self.record.confidence)
        elif figure.kind == "polar":
            draw_polar(target, places, metric, axis, title)
        else:
            own = self.baseline is not None and self.baseline[0] == axis
            compared = self.compared if own else []
            by = figure.lines
            draw_axis(target, places, metric, axis, by, compared, title, self.record.confidence)
        return True

    def _draw_spread(self, target: BinaryIO, figure: FigureRecord) -> bool:
        """Draw how a result is spread over the runs, one series per value of an axis."""
        metric = str(figure.metric)
        if figure.axis is not None and figure.axis not in self.rows.axes:
            return False
        if any(result.name == metric and not result.is_number for result in self.results):
            return False
        axis = figure.axis or next(iter(self.rows.axes), None)
        found: dict[Any, list[FloatArray]] = {}
        for at, rows in self.rows.each_place():
            value = None if axis is None else at[self.rows.axes.index(axis)]
            found.setdefault(value, []).append(self.rows.column(metric)[rows].astype(float))
        series = [
            ("" if axis is None else value_label(axis, value), np.concatenate(values))
            for value, values in found.items()
        ]
        (mark,) = (result.mark for result in self.results if result.name == metric)
        draw = draw_histogram if figure.kind == "histogram" else draw_cdf
        title = _shortened(self.record.title if figure.title is None else figure.title)
        draw(target, series, metric, title, mark)
        return True

    def _draw_series(self, target: BinaryIO, figure: FigureRecord) -> bool:
        """Draw results whose names differ in a number, one line per place of the axes."""
        metric = str(figure.metric)
        known = of_series(metric, [line.result.name for line in self.lines])
        by_place: dict[tuple[Any, ...], dict[str, Line]] = {}
        for line in self.lines:
            if line.result.name in known:
                by_place.setdefault(line.at, {})[line.result.name] = line
        series = [
            (
                ", ".join(value_label(a, v) for a, v in zip(self.rows.axes, at, strict=True)),
                list(known.values()),
                [lines[name] for name in known],
            )
            for at, lines in by_place.items()
        ]
        title = _shortened(self.record.title if figure.title is None else figure.title)
        draw_series(target, series, metric, title, self.record.confidence, figure.freedom)
        return True

    def telling(self, only: Sequence[str] = ()) -> list[str]:
        """Return the results worth a closer look: those named, drawn, or else that differ."""
        drawn = [f.metric for f in self.record.figures if f.metric is not None]
        if only or drawn:
            numbers = {result.name for result in self.results if result.is_number}
            return [name for name in dict.fromkeys(only or drawn) if name in numbers]
        differing = [c.result for c in self.compared if c.difference.paired.half_width > 0]
        return list(dict.fromkeys(r.name for r in differing if r.kind in (NUMBER, FRACTION)))[
            :_MOST_SCATTERS
        ]

    def _draw_scatters(self, axis: str, baseline: Any, only: Sequence[str]) -> list[Path]:
        """Draw results of two types in one block against each other."""
        if not axis.startswith("swap."):
            return []
        place = self.rows.axes.index(axis)
        by_place = dict(self.rows.each_place())
        paths = []
        for at, chosen in by_place.items():
            base = (*at[:place], baseline, *at[place + 1 :])
            if at[place] == baseline or base not in by_place:
                continue
            for metric in self.telling(only):
                _, first, second = paired(self.rows, metric, by_place[base], chosen)
                name = "-".join(["scatter", metric, *map(str, at)])
                names, drawn = (str(baseline), str(at[place])), io.BytesIO()
                draw_scatter(drawn, first, second, names, metric, _shortened(self.record.title))
                paths.append(self._write(f"{safe_name(name)}.png", drawn))
        return paths

    def _draw_run(self, cell: int, replica: int) -> list[Path]:
        """Run one replica of a cell again and draw it as ``dsa-des run`` does."""
        from dsa_des.running.recorded_run import record_run

        if self.study is None:  # nothing of the folder's is imported, so nothing is run
            return []
        if cell >= len(self.study.cells) or replica >= self.study.replicas:
            return []
        scene = scene_of(self.study.scene(cell), self.study.replica(replica, cell))
        target = self.folder.path / f"run-cell-{cell}-replica-{replica}"
        if target.is_symlink():
            raise UsageError(f"{target}: is a link; the figures of a run are in a folder")
        record_run(scene, target)
        return sorted(target.glob("*.png"))


def cut_off_text(line: Line) -> str:
    """Return ``12 of 200 at the start, 3 never``; nothing where the run cut nothing off."""
    texts = [f"{many:,} {shortened(where)}" for where, many in line.cut_off]
    texts[:1] = [text.replace(" ", f" of {line.runs:,} ", 1) for text in texts[:1]]
    return ", ".join(texts)


def _shortened(title: str) -> str:
    return title if len(title) <= _LONGEST_TITLE else f"{title[: _LONGEST_TITLE - 1]}…"


def safe_name(name: str) -> str:
    """Return a text as the name of a file: without signs of a path, and short enough for one."""
    plain = "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
    if len(plain.encode()) <= _LONGEST_NAME:
        return plain
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    cut = plain.encode()[: _LONGEST_NAME - 9].decode("utf-8", "ignore")
    return f"{cut}-{digest}"


def _parquet(columns: dict[str, list[Any]]) -> bytes:
    import pyarrow as pa

    return parquet(pa.table(columns))
