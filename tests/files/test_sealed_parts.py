"""A part is good to the last byte, and one of this study, or it is run again."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result
from hypothesis import given
from hypothesis import strategies as st

from dsa_des.cli import main
from dsa_des.files.sealed_files import is_sealed, seal_parquet, sealable_parquet
from tests.studies.conftest import small

__all__ = ["small"]

STUDY = """
scene = "small.toml"
seed = 3
replicas = 6
runs_per_chunk = 2
metrics = ["first_detection"]
set.duration_s = 2
"""
PART = "part-000-000001.parquet"


def dsa_des(*words: str, code: int = 0) -> Result:
    result = CliRunner().invoke(main, words)
    assert result.exit_code == code, result.output
    return result


def parts(folder: str = "o") -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path(folder, "parts").iterdir()}


@pytest.fixture
def whole(small: Path) -> dict[str, bytes]:
    """The parts of a small study in the folder ``o``."""
    Path("study.toml").write_text(STUDY)
    dsa_des("study", "study.toml", "--workers", "1", "--out", "o", "--quiet")
    return parts()


def resumed() -> dict[str, bytes]:
    dsa_des("study", "study.toml", "--workers", "1", "--out", "o", "--quiet", "--resume")
    return parts()


def _page(content: bytes) -> bytes:
    return content[:4] + b"\xff" * 36 + content[40:]


def _bit(content: bytes) -> bytes:
    middle = len(content) // 3
    return content[:middle] + bytes([content[middle] ^ 4]) + content[middle + 1 :]


def _older(content: bytes) -> bytes:
    """The same rows as an earlier version wrote them: without a seal."""
    sink = pa.BufferOutputStream()
    pq.write_table(pq.read_table(pa.BufferReader(content)).replace_schema_metadata(None), sink)
    return sink.getvalue().to_pybytes()


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "a page": _page,
    "a bit": _bit,
    "cut short": lambda content: content[:-1],
    "cut in the middle": lambda content: content[: len(content) // 2],
    "longer": lambda content: content + b"\0",
    "empty": lambda content: b"",
    "older": _older,
    "of a text": lambda content: b"PAR1" * 100,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_part_is_told_and_mended(whole: dict[str, bytes], damage: str) -> None:
    Path("o/parts", PART).write_bytes(DAMAGES[damage](whole[PART]))
    for command in (("study", "show", "o"), ("compare", "o")):
        error = dsa_des(*command, code=2).stderr
        assert error.count("\n") == 1 and f"{PART}; --resume writes damaged parts anew" in error
    assert resumed() == whole


def test_a_part_of_another_place_or_study_is_not_taken(whole: dict[str, bytes]) -> None:
    Path("o/parts", PART).write_bytes(whole["part-000-000000.parquet"])
    assert PART in dsa_des("study", "show", "o", code=2).stderr
    assert resumed() == whole
    Path("study.toml").write_text(STUDY.replace("seed = 3", "seed = 4"))
    dsa_des("study", "study.toml", "--workers", "1", "--out", "other", "--quiet")
    Path("study.toml").write_text(STUDY)
    shutil.copy(Path("other/parts", PART), Path("o/parts", PART))
    assert PART in dsa_des("study", "show", "o", code=2).stderr
    assert resumed() == whole


def test_what_is_no_part_is_left_alone_and_told(whole: dict[str, bytes]) -> None:
    mine = Path("o/parts/mine.parquet")
    mine.write_bytes(whole[PART])
    assert "mine.parquet: is no part of a study" in dsa_des("study", "show", "o", code=2).stderr
    words = ("study", "study.toml", "--out", "o", "--resume", "--workers", "1")
    assert "move it away" in dsa_des(*words, code=2).stderr
    assert mine.read_bytes() == whole[PART]


@given(st.data())
def test_every_changed_byte_breaks_the_seal(data: st.DataObject) -> None:
    table = pa.table({"a": [1, 2], "b": ["dsa_des.sha256\x18@" + "0" * 64, None]})
    content = seal_parquet(sealable_parquet(table), "me")
    assert is_sealed(content, "me") and not is_sealed(content, "you")
    assert pq.read_table(pa.BufferReader(content)).to_pydict() == table.to_pydict()
    place = data.draw(st.integers(0, len(content) - 1))
    value = data.draw(st.integers(0, 255).filter(lambda byte: byte != content[place]))
    changed = content[:place] + bytes([value]) + content[place + 1 :]
    assert not is_sealed(changed, "me")
    assert not is_sealed(content[:place], "me")


def test_rounds_of_a_stopped_study_are_not_decided_by_what_came_later(small: Path) -> None:
    stop = 'stop_when = {metric = "detected.radar", half_width = 0.16, batch = 3}'
    text = STUDY.replace("replicas = 6", "replicas = 24").replace(
        "duration_s = 2", "duration_s = 6"
    )
    reach = "axes.blocks.radar.reach_km = [4.7, 4.85, 4.95]"
    Path("study.toml").write_text(f"{stop}\n{text}\n{reach}\n")
    dsa_des("study", "study.toml", "--workers", "1", "--out", "o", "--quiet")
    whole = parts()
    rounds = {name.split("-")[1] for name in whole}
    assert len(rounds) > 2
    for name in whole:
        if name.startswith("part-001"):  # an early round is damaged, later ones are there
            Path("o/parts", name).write_bytes(b"")
    assert resumed() == whole
