"""A figure's file name ends as pictures do; anything else is refused before work begins."""

import pytest
from click.testing import CliRunner

from dsa_des.cli import main

CROSSING = "configs/encounters/crossing.daa"
COMMANDS = {
    "alert": ["alert", CROSSING, "--conf", "configs/alerting/do365b.conf", "--out", "a.csv",
              "--figure"],
    "show": ["encounters", "show", CROSSING, "--figure"],
    "graph": ["graph", "configs/first_light.toml", "--png", "--out"],
}  # fmt: skip


@pytest.mark.parametrize("command", sorted(COMMANDS))
@pytest.mark.parametrize("name", ["x.xyz", "x.pdf", "x"])
def test_another_ending_is_refused(tmp_path, monkeypatch, configs, command, name):
    (tmp_path / "configs").symlink_to(configs)
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, [*COMMANDS[command], name])
    assert result.exit_code == 2, result.output
    option = COMMANDS[command][-1]
    assert f"{option} {name}: a name that ends in .png is needed" in result.output
    assert ("; x.png would do" in result.output) is (name == "x")
    assert [path.name for path in tmp_path.iterdir()] == ["configs"]


def test_capitals_will_do(tmp_path, monkeypatch, configs):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(
        main, ["graph", str(configs / "first_light.toml"), "--png", "--out", "x.PNG"]
    )
    assert result.exit_code == 0 and (tmp_path / "x.PNG").exists()
