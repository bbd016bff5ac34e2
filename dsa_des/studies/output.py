"""What a study leaves beside its parts: ``summary.parquet``, ``differences.parquet``, figures."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dsa_des.errors import SceneError
from dsa_des.replicas import scene_of
from dsa_des.studies.figures import Places, draw_axis, draw_heat, draw_polar, draw_scatter
from dsa_des.studies.folder import StudyFolder
from dsa_des.studies.metric import NUMBER
from dsa_des.studies.runner import results_of
from dsa_des.studies.study import Study
from dsa_des.studies.summary import Compared, Line, Rows, compare_axis, paired, summarise

#: Replicas whose random draws an analytic answer is averaged over.
_EXPECTED_OVER = 64
_MOST_SCATTERS = 6


class Tables:
    """The tables of a study.

    Parameters
    ----------
    study : Study
    folder : StudyFolder
        With results.
    """

    def __init__(self, study: Study, folder: StudyFolder) -> None:
        self.study, self.folder = study, folder
        self.results = results_of(study)
        axes = [axis.column for axis in study.axes]
        self.rows = Rows(folder.results(), axes, study.over)
        self.lines: list[Line] = summarise(
            self.rows, self.results, study.confidence, study.interval, self._expected()
        )
        self.compared: list[Compared] = []
        if study.baseline is not None and study.baseline[0] in self.rows.axes:
            axis, value = study.baseline
            value = float(value) if isinstance(value, int) else value
            self.compared = compare_axis(
                self.rows, axis, value, self.results, study.confidence, study.interval
            )

    def _expected(self) -> dict[tuple[str, tuple[Any, ...]], float]:
        """Return the analytic answers at every place, averaged over draws and encounters."""
        study = self.study
        sums: dict[tuple[str, tuple[Any, ...]], list[float]] = {}
        replicas = [study.replica(k) for k in range(min(study.replicas, _EXPECTED_OVER))]
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
                for replica in replicas if study.draws else replicas[:1]:
                    own = scene_of(scene, replica)
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
        wanted = set(only) or {str(f["metric"]) for f in self.study.figures if "metric" in f}
        if self.study.stop_when is not None and not only:
            wanted.add(self.study.stop_when.metric)
        return [line for line in self.lines if not wanted or line.result.name in wanted]

    def write(self) -> None:
        """Write the summary and the differences."""
        self.folder.write_file("summary.parquet", _parquet(self._summary_columns()))
        if self.compared:
            self.folder.write_file("differences.parquet", _parquet(self._difference_columns()))

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
            "expected": [line.expected for line in self.lines],
        }
        return columns

    def _difference_columns(self) -> dict[str, list[Any]]:
        assert self.study.baseline is not None
        axis = self.study.baseline[0]
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
        return columns

    def draw(self, only: Sequence[str] = ()) -> list[Path]:
        """Draw the study's figures and return their paths.

        `only` names the results whose conditions are drawn against each other where there is a
        swap; by default those that the figures show, or the first ones.
        """
        paths: list[Path] = []
        for number, figure in enumerate(self.study.figures):
            path = self.folder.path / f"figure-{number + 1:02d}-{figure['kind']}.png"
            if figure["kind"] == "run":
                paths += self._draw_run(int(figure.get("cell", 0)), int(figure.get("replica", 0)))
            elif self._draw_one(path, figure):
                paths.append(path)
        if self.compared and self.study.baseline is not None:
            paths += self._draw_scatters(*self.study.baseline, only)
        return paths

    def _draw_one(self, path: Path, figure: dict[str, Any]) -> bool:
        places = Places(self.rows.axes, self.lines)
        if not places.axes:
            return False
        metric = str(figure["metric"])
        title = str(figure.get("title", self.study.title))
        axis = str(figure.get("axis", places.axes[0]))
        if figure["kind"] == "heat":
            x = str(figure.get("x", places.axes[0]))
            y = str(figure.get("y", next((a for a in places.axes if a != x), x)))
            if x == y:
                return False
            draw_heat(path, places, metric, x, y, title)
        elif figure["kind"] == "polar":
            draw_polar(path, places, metric, axis, title)
        else:
            own = self.study.baseline is not None and self.study.baseline[0] == axis
            compared = self.compared if own else []
            by = figure.get("lines")
            draw_axis(path, places, metric, axis, by, compared, title, self.study.confidence)
        return True

    def telling(self, only: Sequence[str] = ()) -> list[str]:
        """Return the results worth a closer look: those named, drawn, or else that differ."""
        drawn = [str(f["metric"]) for f in self.study.figures if "metric" in f]
        if only or drawn:
            return list(dict.fromkeys(only or drawn))
        differing = [c.result for c in self.compared if c.difference.paired.half_width > 0]
        return list(dict.fromkeys(r.name for r in differing if r.kind == NUMBER))[:_MOST_SCATTERS]

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
                path = self.folder.path / f"{_safe(name)}.png"
                names = (str(baseline), str(at[place]))
                draw_scatter(path, first, second, names, metric, self.study.title)
                paths.append(path)
        return paths

    def _draw_run(self, cell: int, replica: int) -> list[Path]:
        """Run one replica of a cell again and draw it as ``dsa-des run`` does."""
        from dsa_des.commands.run import record_run

        if cell >= len(self.study.cells) or replica >= self.study.replicas:
            return []
        scene = scene_of(self.study.scene(cell), self.study.replica(replica))
        target = self.folder.path / f"run-cell-{cell}-replica-{replica}"
        record_run(scene, target)
        return sorted(target.glob("*.png"))


def _safe(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name)


def _parquet(columns: dict[str, list[Any]]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    pq.write_table(pa.table(columns), buffer, compression="zstd")
    return buffer.getvalue()
