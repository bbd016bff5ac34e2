"""Every ladder that our blocks declare can be climbed: its rungs exist and share ports."""

import pytest
from click.testing import CliRunner

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.ladder import Ladder, Quantity, Rung
from dsa_des.block.registry import find_component
from dsa_des.cli import main
from dsa_des.costs.climb import allowed_errors_by_unit, flag_points_on_front
from dsa_des.errors import UsageError

LADDERS = [
    pytest.param(name, ladder, id=f"{name}-{ladder.name}")
    for name in entry_points_of()
    for ladder in find_component(name).ladders
]


@pytest.mark.parametrize(("type_name", "ladder"), LADDERS)
def test_rungs_fill_the_same_contract(type_name, ladder):
    mine = find_component(type_name)
    for rung in ladder.rungs:
        cls = find_component(rung.type_name) if rung.type_name else mine
        assert {p: i.message for p, i in cls.inputs.items()} == {
            p: i.message for p, i in mine.inputs.items()
        }
        assert {p: o.message for p, o in cls.outputs.items()} == {
            p: o.message for p, o in mine.outputs.items()
        }
        if not callable(rung.parameters):
            assert set(rung.parameters) | set(rung.shared) <= set(cls.Parameters.model_fields)


def test_every_sensor_transform_and_fusion_has_a_ladder():
    without = {name for name in entry_points_of() if not find_component(name).ladders}
    without -= {"fusion.pass_through"}  # puts nothing together: there is nothing to be exact about
    assert without.isdisjoint({name for name in entry_points_of() if name.split(".")[0] in (
        "radar", "optical", "geometry", "fusion")})  # fmt: skip


def test_components_shows_the_ladder():
    shown = CliRunner().invoke(main, ["components", "radar.swerling"]).output
    assert "ladder detection" in shown and "gram_charlier" in shown and "reference" in shown


def test_a_ladder_says_what_is_wrong_with_it():
    quantity, rung = Quantity("x", "m"), Rung("a", "")
    with pytest.raises(ValueError, match="its reference 'b' is none of its rungs"):
        Ladder("l", (rung,), "b", (quantity,), lambda *_: {})
    with pytest.raises(ValueError, match="two rungs have one name"):
        Ladder("l", (rung, rung), "a", (quantity,), lambda *_: {})
    with pytest.raises(ValueError, match="at least one quantity"):
        Ladder("l", (rung,), "a", (), lambda *_: {})


def test_the_front_holds_what_nothing_beats():
    points = [(1, 5), (2, 5), (2, 3), (3, 3), (4, 0), (5, float("nan")), (1, 5)]
    assert flag_points_on_front(points) == [True, False, True, False, True, False, True]


def test_budgets_are_numbers_with_a_unit_of_the_ladders():
    ladders = [ladder for name in entry_points_of() for ladder in find_component(name).ladders]
    assert allowed_errors_by_unit(["0.5mrad", "2 m", "1e-3pd", "1m2"], ladders) == {
        "mrad": 0.5, "m": 2.0, "Pd": 1e-3, "m²": 1.0}  # fmt: skip
    for wrong in ("mrad", "0mrad", "-1m", "1.2.3m", "1furlong", "nan m"):
        with pytest.raises(UsageError, match="--budget"):
            allowed_errors_by_unit([wrong], ladders)
