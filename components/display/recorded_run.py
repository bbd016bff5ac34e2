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
    """A run's recorded tables in Arrow by name; UsageError for a missing table or column."""

    folder: Path
    tables: Mapping[str, Any]
    _kept: dict[tuple[str, str], Any] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def scene(self) -> dict[str, Any]:
        """The run's scene as parsed TOML; empty where the folder has no scene file."""
        path = self.folder / "scene.toml"
        try:
            return tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError:
            return {}
        except ValueError as error:
            raise UsageError(f"{path}: is not TOML ({error})") from error

    def block_types(self, names: Iterable[str]) -> dict[str, str]:
        """Return each block's type by name, as the run's scene gives it; empty if not known."""
        blocks = self.scene.get("blocks", {})
        return {name: str(blocks.get(name, {}).get("type", "")) for name in names}

    def has_columns(self, table: str, *names: str) -> bool:
        """Return whether a table was recorded and has all columns with these names."""
        return table in self.tables and {*names} <= {*self.table(table).column_names}

    @cached_property
    def platform_by_block(self) -> dict[str, str]:
        """Each block's platform (name), the ownship's blocks first; empty if none were recorded."""
        found = {
            (on, block)
            for name, table in self.tables.items()
            if self.has_columns(name, "block", "platform")
            for block, on in _block_platform_pairs(table)
            if on is not None
        }
        # Without truth it is by its usual name that the ownship is known.
        in_order = sorted(
            found, key=lambda of: (of[0] in self._true_target_names, of[0] != OWNSHIP, of)
        )
        return {block: on for on, block in in_order}

    @cached_property
    def _true_target_names(self) -> set[str | None]:
        return {*self.texts("truth", "target")} if self.has_columns("truth", "target") else set()

    @cached_property
    def own_name(self) -> str:
        """Name by which other platforms detect the ownship: the first recorded name that is no true
        target's.
        """
        if not self.platform_by_block:
            return OWNSHIP
        seen = {name: None for table in ("detections", "tracks", "alerts")
                if self.has_columns(table, "target") for name in self.texts(table,
                "target")}  # fmt: skip
        known = [name for name in (*self.platform_by_block.values(), *seen) if name is not None]
        return next((name for name in known if name not in self._true_target_names), OWNSHIP)

    def seen_from(self, platform: str) -> "RecordedTables":
        """Return the tables of the blocks on one platform, with that platform as the ownship."""
        names = list(dict.fromkeys(self.platform_by_block.values()))
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
    def _detections_with_pose(self) -> Any:
        return join_row_columns(self.tables, "detections")

    def table(self, name: str) -> Any:
        """Return a table by name; ``detections`` has the ownship's pose at each as more columns."""
        return self._detections_with_pose if name == "detections" else self.tables[name]

    def true_flights(self) -> dict[str, dict[str, FloatArray]]:
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
        """Return true poses at these recorded times, (6, n): lat, lon (deg), alt (m), yaw, pitch,
        roll (rad), of the ownship or a named platform; None if one is missing.
        """
        own = self.true_flights().get(platform or self.own_name)
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
        """Return a column as float64, NaN where it is null; UsageError if it is not numeric."""
        try:
            column = self._column(table, name).to_numpy(zero_copy_only=False)
            return np.asarray(column, dtype=np.float64)
        except (TypeError, ValueError):
            raise UsageError(f"{self.folder}: {table}.parquet: {name} holds no numbers") from None

    def stack_columns(
        self, table: str, names: Iterable[str], rows: IntArray | slice = slice(None)
    ) -> FloatArray:
        """Return several numeric columns of the chosen rows as one array, (columns, rows)."""
        return np.stack([self.numbers(table, name)[rows] for name in names])

    def texts(self, table: str, name: str) -> list[str | None]:
        """Return a column of texts as a list, None for null; UsageError for other contents."""
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
        """Return a column of numbers or booleans in its own type; UsageError for other kinds."""
        result: AnyArray = self._column(table, name).to_numpy(zero_copy_only=False)
        if result.dtype.kind not in "biuf":
            return self.numbers(table, name)
        return result

    def _column(self, table: str, name: str) -> Any:
        columns = self.table(table)
        if columns.column_names.count(name) != 1:
            raise UsageError(f"{self.folder}: {table}.parquet: there is no column {name!r}")
        return columns[name]


def _block_platform_pairs(table: Any) -> set[tuple[str, str | None]]:
    """Return the (block, platform) pairs that occur in a table."""
    rows = table.select(["block", "platform"]).group_by(["block", "platform"]).aggregate([])
    return {(row["block"], row["platform"]) for row in rows.to_pylist()}


def _rows_on_platform(name: str, table: Any, platform: str, first: str) -> Any:
    """Return a platform's rows; of ``truth`` all, its name exchanged for the ownship's."""
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
    """Return a run's recorded tables, from a folder's path or the result of `dsa_des.run`."""
    if isinstance(run, Run):
        return RecordedTables(run.path or Path("the run"), run.tables)
    return read_tables(os.fspath(run))


def hint_for_shipped_scene(name: str) -> str:
    """Return an error message's end for a shipped scene named instead of a run; else empty."""
    scene = find_example(name, "scene")
    return f"; of the scene: dsa-des run {name}, then the folder it names" if scene else ""


def read_tables(run: str) -> RecordedTables:
    """Return a run folder's tables; UsageError if it is none or a table cannot be read."""
    folder = Path(run)
    if not folder.is_dir():
        raise UsageError(f"{run}: there is no such folder{hint_for_shipped_scene(run)}")
    paths = sorted(folder.glob("*.parquet"))
    if not (folder / "run.json").is_file() or not paths:
        raise UsageError(f"{run}: holds no run: run.json or its tables are missing")
    return RecordedTables(folder, {path.stem: read_table(path) for path in paths})


def read_table(path: Path) -> Any:
    """Return a Parquet file as an Arrow table; UsageError if it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        raise UsageError(f"{path}: is no Parquet file that can be read ({error})") from error
