"""Which page decides, and which of its messages are accepted."""

import json

import pytest

from components.cdti.page import (
    LARGEST_BYTES,
    OPERATOR,
    WATCHER,
    Admission,
    Chosen,
    Climbed,
    Drawn,
    Judged,
    Ready,
    Turned,
    read_message,
)


def test_the_first_page_decides_and_the_second_watches():
    door = Admission()
    role, key = door.role_and_key(door.token, "")
    assert role == OPERATOR and len(key) >= 32
    assert door.role_and_key(door.token, "") == (WATCHER, "")
    assert door.role_and_key(door.token, "guess") == (WATCHER, "")
    assert door.role_and_key(door.token, key) == (OPERATOR, key)  # the same page, loaded again


def test_a_token_is_of_one_run_and_not_to_be_guessed():
    door, other = Admission(), Admission()
    assert door.is_issued_token(door.token) and not door.is_issued_token(other.token)
    assert (
        not door.is_issued_token("")
        and not door.is_issued_token(door.token[:-1])
        and not door.is_issued_token("\udcff")
    )
    assert len(door.token) >= 32


def test_a_new_address_decides_where_the_old_one_no_longer_does():
    door = Admission()
    old = door.token
    assert door.unused_operator_token() == old  # nobody has come yet
    _, key = door.role_and_key(old, "")
    new = door.unused_operator_token()
    assert new != old and door.unused_operator_token() == new
    assert door.role_and_key(old, "") == (WATCHER, "")
    assert door.role_and_key(new, "")[0] == OPERATOR
    assert door.role_and_key(old, key) == (WATCHER, "")  # who comes back late has lost its place
    assert door.is_issued_token(old) and door.is_issued_token(new)


ID = "0123456789abcdef"


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        ({"type": "ready"}, Ready),
        ({"type": "drawn", "frame": 3}, Drawn),
        ({"type": "chosen", "target": -1}, Chosen),
        ({"type": "decide", "id": ID, "decision": "verified", "target": 0}, Judged),
        ({"type": "decide", "id": ID, "decision": "turn", "target": 0, "value": -30}, Turned),
        ({"type": "decide", "id": ID, "decision": "climb", "target": -1, "value": 152.4}, Climbed),
    ],
)
def test_what_a_page_says_is_understood(said, kind):
    assert isinstance(read_message(json.dumps(said)), kind)


DECIDE = {"type": "decide", "id": ID, "decision": "turn", "target": 0, "value": 20}


@pytest.mark.parametrize(
    "said",
    [
        "", "null", "[]", "{", '"ready"', "{}", '{"type":"Ready"}', '{"type":"ready","more":1}',
        b"ready", "[" * 1000, " " * (LARGEST_BYTES + 1),
        *(json.dumps({**DECIDE, **change}) for change in (
            {"value": 180.5}, {"value": "20"}, {"value": None}, {"value": True}, {"value": [20]},
            {"target": 1.5}, {"target": "0"}, {"target": -2}, {"target": 10**9},
            {"id": "x" * 16}, {"id": ID * 3}, {"id": ""}, {"decision": "shown"},
            {"decision": "land"}, {"decision": "climb", "value": 3001},
        )),
        json.dumps({**DECIDE, "value": 20})[:-1] + ',"value":NaN}',
        json.dumps({**DECIDE, "value": 20})[:-1] + ',"value":1e999}',
    ],
)  # fmt: skip
def test_nothing_else_is_understood(said):
    with pytest.raises(ValueError) as refused:
        read_message(said)
    assert len(str(refused.value)) < 200
