"""Of what a page says, only what it may say is heard."""

import json

import pytest

from components.cdti.page import (
    LARGEST_BYTES,
    Chosen,
    Climbed,
    Drawn,
    Judged,
    Ready,
    Turned,
    read_message,
)

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
