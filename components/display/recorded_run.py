"""The tables of a run's folder, for pages and for files of other programs."""

import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from components.messages.columns import POSE as POSE_COLUMNS
from dsa_des.arrays.types import AnyArray, FloatArray, IntArray
from dsa_des.errors import UsageError, did_you_mean
from dsa_des.record.run_folder import Run, join_row_columns
from dsa_des.scene.examples import find_example

_STATE = (
    "time_s", "lat_deg", "lon_deg", "alt_m", "velocity_north_m_s", "velocity_east_m_s",
    "velocity_down_m_s", "heading_rad", "pitch_rad", "roll_rad",
)  # fmt: skip
OWNSHIP = "ownship"
#: What a pose is made of, as recorded with what was measured.
POSE = tuple(POSE_COLUMNS)
# Greater than any position, speed or time of a run.
_LARGEST = 1e10


@dataclass(frozen=True)
class RecordedTables:
    """A run's tables by name, as Arrow holds them; what they lack is a `UsageError`."""

    folder: Path
    tables: Mapping[str, Any]
    _kept: dict[tuple[str, str], Any] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def scene(self) -> dict[str, Any]:
        """The scene that was run, nothing where there is no file; `UsageError` if it is no TOML."""
        path = self.folder / "scene.toml"
        try:
            return tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError:
            return {}
        except ValueError as error:
            raise UsageError(f"{path}: is not TOML ({error})") from error

    def block_types(self, names: Iterable[str]) -> dict[str, str]:
        """Return name → type of blocks as the scene says it, nothing of those it does not know."""
        blocks = self.scene.get("blocks", {})
        return {name: str(blocks.get(name, {}).get("type", "")) for name in names}

    def has(self, table: str, *names: str) -> bool:
        """Return whether a table is recorded and has columns."""
        return table in self.tables and {*names} <= {*self.table(table).column_names}

    @cached_property
    def carrying(self) -> dict[str, str]:
        """Return the platform of each block, the ownship's first; empty where there is only one."""
        found = {
            (on, block)
            for name, table in self.tables.items()
            if self.has(name, "block", "platform")
            for block, on in _pairs(table)
            if on is not None
        }
        # Without truth it is by its usual name that the ownship is known.
        in_order = sorted(found, key=lambda of: (of[0] in self._targets, of[0] != OWNSHIP, of))
        return {block: on for on, block in in_order}

    @cached_property
    def _targets(self) -> set[str | None]:
        return {*self.texts("truth", "target")} if self.has("truth", "target") else set()

    @cached_property
    def own_name(self) -> str:
        """Return the name that other platforms give the ownship, which is no true target."""
        if not self.carrying:
            return OWNSHIP
        seen = {name: None for table in ("detections", "tracks", "alerts")
                if self.has(table, "target") for name in self.texts(table, "target")}  # fmt: skip
        known = [name for name in (*self.carrying.values(), *seen) if name is not None]
        return next((name for name in known if name not in self._targets), OWNSHIP)

    def seen_from(self, platform: str) -> "RecordedTables":
        """Return what one of several platforms has: it is the ownship, which takes its place."""
        names = list(dict.fromkeys(self.carrying.values()))
        if platform not in names:
            raise UsageError(
                f"{self.folder}: --platform {platform!r}: nothing of this run is carried by it"
                f"{did_you_mean(platform, names)}"
            )
        own = self.own_name
        tables = {
            name: _rows_on_platform(name, table, platform, own)
            for name, table in self.tables.items()
        }
        return replace(self, tables=tables, _kept={})

    @cached_property
    def _join_pose(self) -> Any:
        return join_row_columns(self.tables, "detections")

    def table(self, name: str) -> Any:
        """Return a table; detections have with them where the ownship was at each."""
        return self._join_pose if name == "detections" else self.tables[name]

    def flights(self) -> dict[str, dict[str, FloatArray]]:
        """Return the true flight of each aircraft by its name, the ownship first.

        The columns of `_STATE` in order of time; refused without truth, or if a target is called as
        the ownship is here (`own_name`).
        """
        if "truth" not in self.tables:
            raise UsageError(
                f"{self.folder}: has no truth.parquet, which holds the flights: it is recorded "
                "where it is small; ask for it with truth = true under [record]"
            )
        names, own = self.texts("truth", "target"), self.own_name
        if own in names:
            raise UsageError(f"{self.folder}: a target is called {own!r}: rename it")
        result: dict[str, dict[str, FloatArray]] = {}
        columns = {name: self.numbers("truth", name) for name in _STATE}
        self.refuse_large_values("truth", columns)
        aircraft = np.array([own if name is None else name for name in names], dtype=object)
        for name in [own, *sorted({n for n in names if n is not None})]:
            mine = np.flatnonzero(aircraft == name)
            mine = mine[np.argsort(columns["time_s"][mine], kind="stable")]
            time_s, first = np.unique(columns["time_s"][mine], return_index=True)
            if len(time_s):
                result[name] = {key: values[mine][first] for key, values in columns.items()}
        return result

    def true_poses(self, time_s: FloatArray, platform: str | None = None) -> FloatArray | None:
        """Return the true poses (6, n) of a platform, by default the ownship; None where one of the
        instants has none.
        """
        own = self.flights().get(platform or self.own_name)
        if own is None:
            return None
        at = np.minimum(np.searchsorted(own["time_s"], time_s), len(own["time_s"]) - 1)
        if (own["time_s"][at] != time_s).any():
            return None
        return np.stack([own[name.removeprefix("own_")][at] for name in POSE])

    def refuse_large_values(self, table: str, columns: Mapping[str, FloatArray]) -> None:
        """Raise `UsageError` for a value that is NaN or too large, naming column and row."""
        for name, values in columns.items():
            large = ~(np.abs(values) <= _LARGEST)
            if large.any():
                row = int(np.argmax(large))
                raise UsageError(
                    f"{self.folder}: {table}.parquet: {name} in row {row} is {values[row]:g}: a "
                    f"flight needs numbers within ±{_LARGEST:g}"
                )

    def numbers(self, table: str, name: str) -> FloatArray:
        """Return a column as numbers, NaN where it is null; refuse one that is not numeric."""
        try:
            column = self._column(table, name).to_numpy(zero_copy_only=False)
            return np.asarray(column, dtype=np.float64)
        except (TypeError, ValueError):
            raise UsageError(f"{self.folder}: {table}.parquet: {name} holds no numbers") from None

    def stack_columns(
        self, table: str, names: Iterable[str], rows: IntArray | slice = slice(None)
    ) -> FloatArray:
        """Return columns of numbers of some rows, (columns, rows)."""
        return np.stack([self.numbers(table, name)[rows] for name in names])

    def texts(self, table: str, name: str) -> list[str | None]:
        """Return a column of texts, as `numbers` does one of numbers."""
        if (table, name) not in self._kept:
            result = self._column(table, name).to_pylist()
            if not all(text is None or isinstance(text, str) for text in result):
                raise UsageError(
                    f"{self.folder}: {table}.parquet: {name} holds something else than text"
                )
            self._kept[table, name] = result
        texts: list[str | None] = self._kept[table, name]
        return texts

    def values(self, table: str, name: str) -> AnyArray:
        """Return a column of numbers or flags as an array of its own type; refuse any other."""
        result: AnyArray = self._column(table, name).to_numpy(zero_copy_only=False)
        if result.dtype.kind not in "biuf":
            return self.numbers(table, name)
        return result

    def _column(self, table: str, name: str) -> Any:
        columns = self.table(table)
        if columns.column_names.count(name) != 1:
            raise UsageError(f"{self.folder}: {table}.parquet: there is no column {name!r}")
        return columns[name]


def _pairs(table: Any) -> set[tuple[str, str | None]]:
    """Return which blocks have rows in a table, each with what carries it."""
    rows = table.select(["block", "platform"]).group_by(["block", "platform"]).aggregate([])
    return {(row["block"], row["platform"]) for row in rows.to_pylist()}


def _rows_on_platform(name: str, table: Any, platform: str, first: str) -> Any:
    """Return a table's rows of blocks on a platform; of the truth all, as seen from it."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if name == "truth":
        if platform == first:
            return table
        flown = [first if of is None else of for of in table["target"].to_pylist()]
        seen = pa.array([None if of == platform else of for of in flown], pa.string())
        return table.set_column(table.column_names.index("target"), "target", seen)
    if "platform" not in table.column_names:
        return table
    return table.filter(pc.equal(table["platform"].cast(pa.string()), platform))


def tables_of(run: Run | str | os.PathLike[str]) -> RecordedTables:
    """Return the tables of a run: a folder's path, or what `dsa_des.run` returns."""
    if isinstance(run, Run):
        return RecordedTables(run.path or Path("the run"), run.tables)
    return read_tables(os.fspath(run))


def suggest_scene(name: str) -> str:
    """Return what to do where a shipped scene is named in the place of a run, or nothing."""
    scene = find_example(name, "scene")
    return f"; of the scene: dsa-des run {name}, then the folder it names" if scene else ""


def read_tables(run: str) -> RecordedTables:
    """Read all tables of a run's folder; `UsageError` where it is none or one cannot be read."""
    folder = Path(run)
    if not folder.is_dir():
        raise UsageError(f"{run}: there is no such folder{suggest_scene(run)}")
    paths = sorted(folder.glob("*.parquet"))
    if not (folder / "run.json").is_file() or not paths:
        raise UsageError(f"{run}: holds no run: run.json or its tables are missing")
    return RecordedTables(folder, {path.stem: read_table(path) for path in paths})


def read_table(path: Path) -> Any:
    """Read a table of a run; `UsageError` where it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise UsageError(f"{path}: is no Parquet file that can be read ({error})") from error
