"""Drawn values that are checked as columns give the scenes, and the refusals, of each by itself."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from pydantic import Field, model_validator

from dsa_des.block.component import ClockedParameters, Component
from dsa_des.replicas import drawn_columns as checked
from dsa_des.replicas.changed_scene import Replica, replica_scene
from dsa_des.replicas.drawn_columns import scenes_from_drawn_columns
from dsa_des.replicas.replicas import Failed, Recorded, run_replicas
from dsa_des.scene.scene import load_scene

_MANY = 14


def replicas(**drawn: Any) -> list[Replica]:
    return [
        Replica(40 + k, {f"blocks.{key}": value(k) for key, value in drawn.items()})
        for k in range(_MANY)
    ]


SHAPES: dict[str, dict[str, Any]] = {
    "seeds only": {},
    "offsets": {"radar.offset_s": lambda k: Fraction(k, 10**3),
                "ir.offset_s": lambda k: Fraction(0)},
    "the last as the first": {"radar.offset_s": lambda k: Fraction(k % (_MANY - 1), 10**3)},
    "in a list": {"traffic.intruders[0].east_m": lambda k: 0.25 * k - 1.0,
                  "traffic.intruders.one.speed_mps": lambda k: 50 + k},
    "of several tables": {"traffic.ownship.heading_deg": lambda k: 3.0 * k,
                          "traffic.intruders[0].up_m": lambda k: -k, "ir.reach_km": lambda k: 8.5},
}  # fmt: skip


@pytest.mark.parametrize("drawn", SHAPES.values(), ids=SHAPES)
def test_scenes_are_those_of_each_replica_by_itself(small: Path, drawn: dict[str, Any]) -> None:
    base = load_scene("small.toml")
    runs = replicas(**drawn)
    together = scenes_from_drawn_columns(base, runs)
    assert together is not None and len(together[2:]) == _MANY - 2
    for number, replica in enumerate(runs):
        alone = replica_scene(base, replica)
        for found in (together[number], together[1:][number - 1] if number else together[0]):
            assert found == alone
            for name, block in alone.blocks.items():
                mine: Any = found.blocks[name].parameters
                assert repr(mine) == repr(block.parameters)  # a float where one by one is one
                assert mine.model_fields_set == block.parameters.model_fields_set
    for name in base.blocks:
        mine = [scene.blocks[name].parameters for scene in together]
        assert together.parameters_of(name) == mine
        fields = type(mine[0]).model_fields
        assert together.differing_parameters(name) == {
            field
            for field in fields
            if any(getattr(p, field) != getattr(mine[0], field) for p in mine)
        }


#: What is not checked as columns: a table, a value of no number, an option of the engine, one that
#: not all change, a table that is a section's, a rate (by which ticks may differ), odd instants.
ONE_BY_ONE: dict[str, dict[str, Any]] = {
    "a list": {"radar.azimuth_deg": lambda k: [-60, 60 + k]},
    "an option": {"radar.latency_s": lambda k: Fraction(k, 100)},
    "a rate": {"radar.scan_rate_hz": lambda k: Fraction(5 + k)},
    "ticks of their own": {"radar.offset_s": lambda k: Fraction(1, 7)},
    "a truth": {"radar.enabled": lambda k: k % 2 == 0},
    "one of two names": {
        "traffic.intruders[0].speed_mps": lambda k: 50.0 + k,
        "traffic.intruders.one.speed_mps": lambda k: 60.0 + k,
    },
    "a whole table": {"traffic.intruders[0]": lambda k: {"name": "one"}},
}


@pytest.mark.parametrize("drawn", ONE_BY_ONE.values(), ids=ONE_BY_ONE)
def test_what_no_column_can_show_is_checked_one_by_one(small: Path, drawn: dict[str, Any]) -> None:
    assert scenes_from_drawn_columns(load_scene("small.toml"), replicas(**drawn)) is None


def test_keys_that_not_all_change_are_checked_one_by_one(small: Path) -> None:
    runs = replicas(**SHAPES["offsets"])
    assert scenes_from_drawn_columns(load_scene("small.toml"), [*runs, Replica(1)]) is None


@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        ("radar.offset_s", Fraction(-1, 10**9)),  # below the field's bound
        ("traffic.intruders[0].east_m", 1e13),  # beyond what can be computed with
        ("traffic.intruders[0].east_m", -1e-31),  # too close to 0, between values that are allowed
        ("traffic.intruders[0].east_m", float("nan")),
        ("traffic.intruders[0].east_m", "far"),
    ],
)
def test_one_that_is_refused_is_refused_with_its_own_words(
    small: Path, key: str, wrong: Any
) -> None:
    base = load_scene("small.toml")
    good = [Fraction(1, 100)] if key.endswith("_s") else [-2.0, 0.0, 2.0]
    runs = replicas(**{key: lambda k: wrong if k == 5 else good[k % len(good)]})
    found = run_replicas(base, runs)
    (alone,) = run_replicas(base, runs[5:6])
    assert found[5] == alone and isinstance(alone, Failed) and key in alone.error
    assert sum(isinstance(run, Recorded) for run in found) == _MANY - 1


def test_no_scene_is_made_for_each_replica(small: Path, monkeypatch: Any) -> None:
    made: list[Replica] = []
    with monkeypatch.context() as patched:
        patched.setattr(checked, "replica_scene", lambda *a: made.append(a[1]) or replica_scene(*a))
        patched.setattr(checked.ReplicaScenes, "__iter__", None)
        found = run_replicas(load_scene("small.toml"), replicas(**SHAPES["offsets"]))
    assert all(isinstance(run, Recorded) for run in found) and len(made) == 3


class Fields(ClockedParameters):
    near_m: float = Field(1.0, ge=0)
    far_m: float = Field(5.0, ge=0)
    loud_db: float = Field(0.0, ge=0)


class Ordered(Fields):
    @model_validator(mode="after")
    def _ordered(self) -> "Ordered":
        if self.loud_db < 1 and self.near_m == 2.0:  # an odd one out between the others
            raise ValueError("must not be 2")
        return self


class Dumped(Fields):
    @model_validator(mode="after")
    def _all_of_it(self) -> "Dumped":
        assert 2.0 not in self.model_dump().values()
        return self


class Changing(Fields):
    @model_validator(mode="before")
    @classmethod
    def _other(cls, given: Any) -> Any:
        return given


@pytest.mark.parametrize(
    ("model", "key", "as_column"),
    [
        (Fields, "near_m", True),
        (Ordered, "near_m", False),
        (Ordered, "far_m", True),
        (Dumped, "near_m", False),
        (Changing, "near_m", False),
    ],
)
def test_what_validators_read_is_no_column(
    small: Path, monkeypatch: Any, model: type[Fields], key: str, as_column: bool
) -> None:
    class Own(Component):
        Parameters = model

    base = load_scene("small.toml")
    block = base.blocks["radar"]
    object.__setattr__(block, "cls", Own)
    object.__setattr__(block, "parameters", model(scan_rate_hz=5))  # type: ignore[arg-type]
    found = scenes_from_drawn_columns(base, replicas(**{f"radar.{key}": float}))
    assert (found is not None) == as_column


class OwnClock(ClockedParameters):
    def clock_spec(self) -> Any:
        return super().clock_spec()


def test_a_clock_of_its_own_making_is_asked_one_by_one(small: Path) -> None:
    base = load_scene("small.toml")
    block = base.blocks["radar"]
    drawn = replicas(**{"radar.offset_s": lambda k: Fraction(k, 100)})
    for model, as_column in ((ClockedParameters, True), (OwnClock, False)):
        object.__setattr__(block, "cls", type("Own", (Component,), {"Parameters": model}))
        object.__setattr__(block, "parameters", model(scan_rate_hz=5))  # type: ignore[arg-type]
        assert (scenes_from_drawn_columns(base, drawn) is not None) == as_column
