"""What is written as TOML reads back as it was."""

import math
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsa_des.files.toml_files import to_toml

TEXT = st.text(st.characters(exclude_categories=("Cs",)), max_size=12)
VALUES = st.recursive(
    st.one_of(
        st.booleans(),
        st.integers(-(2**63), 2**63 - 1),
        st.floats(allow_nan=False),
        TEXT,
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(TEXT, inner, max_size=4)),
    max_leaves=12,
)


@settings(derandomize=True, deadline=None, max_examples=100)
@given(tables=st.dictionaries(TEXT, VALUES, max_size=5))
def test_round_trip(tables):
    assert tomllib.loads(to_toml(tables)) == tables


@pytest.mark.parametrize(
    "tables",
    [
        {"🛩": 1, "a.b": {"c d": {"": 2}}},
        {"text": 'quotes " \\ and \n lines \t tabs \x00 \x1f \x7f \u2028'},
        {"a": {"x": 1, "b": {"y": 2}}, "z": 3},
        {"list": [{"name": "head_on", "legs": [{"kind": "turn", "rates": [0.1] * 60}]}]},
        {"numbers": [1e16, 5e-324, -0.0, 1e-7, math.inf, -math.inf, 10**18]},
        {"mixed": [[1, "a"], {"b": [True, {}]}, []], "empty": {}},
    ],
)
def test_hard_tables(tables):
    again = tomllib.loads(to_toml(tables))
    assert again == tables
    assert sorted(map(repr, again.items())) == sorted(map(repr, tables.items()))


def test_nan_is_written():
    assert math.isnan(tomllib.loads(to_toml({"x": math.nan}))["x"])


def test_what_toml_cannot_hold_is_refused():
    with pytest.raises(TypeError, match="NoneType cannot be written as TOML"):
        to_toml({"a": None})
