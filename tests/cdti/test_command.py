"""What the command refuses, in one plain line each."""

import sys

import pytest
from click.testing import CliRunner

from components.cdti.command import cdti
from components.examples import configs_folder

SCENE = str(configs_folder() / "operator" / "session.toml")


def call(*words):
    return CliRunner().invoke(cdti, list(words), catch_exceptions=False)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((SCENE, "--realtime", "fast"), "error: --realtime fast: must be a number above 0"),
        ((SCENE, "--host", "0.0.0.0"), "name the address under which others reach this machine"),
        ((SCENE, "--host", "192.0.2.1"), "error: cannot serve at 192.0.2.1:0: "),
        (("nothing.toml",), "nothing.toml"),
        ((SCENE, "--set", "blocks.radar.scan_rate_hz=0"), "blocks.radar.scan_rate_hz"),
    ],
)
def test_what_cannot_be_is_said_plainly(tmp_path, monkeypatch, words, says):
    pytest.importorskip("websockets", reason="needs the package websockets")
    monkeypatch.chdir(tmp_path)
    done = call(*words)
    assert done.exit_code == 2 and says in done.output and "Traceback" not in done.output
    assert list(tmp_path.iterdir()) == []


def test_without_websockets_it_says_what_is_missing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "components.cdti.server", raising=False)
    for name in [name for name in sys.modules if name.split(".")[0] == "websockets"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "websockets", None)
    done = call(SCENE)
    assert done.exit_code == 2 and done.output.count("\n") == 1
    assert "pip install 'dsa-des[view]'" in done.output
