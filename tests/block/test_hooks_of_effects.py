"""An effect that nothing would call is an error when the scene is checked."""

from inspect import signature

import engine_blocks as blocks
import numpy as np
import pytest
from click.testing import CliRunner
from engine_blocks import Relay

from components.optical.sensors import ElectroOptical
from components.radar.threshold_radar import ThresholdRadar
from components.radar.weather import SNR
from dsa_des.block.component import Context
from dsa_des.block.effect import Effect, Hook, Verdict
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.registry import find_component
from dsa_des.cli import main
from dsa_des.errors import SceneError
from dsa_des.errors.problems import BlockFailure
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene
from dsa_des.time.randomness import Streams


class Halves(Effect):
    """Halves a quantity."""

    def __init__(self, acts_on, name="halves"):
        self.acts_on, self.name = acts_on, name

    def verdict(self, block):
        return Verdict(True, "it always is")

    def build(self, block):
        return lambda cells: 0.5


def radar_with(*effects):
    return type("HalvedRadar", (ThresholdRadar,), {"effects": (*ThresholdRadar.effects, *effects)})


def problems_with(lab, monkeypatch, cls):
    monkeypatch.setattr(blocks, "Swapped", cls, raising=False)
    with pytest.raises(SceneError) as caught:
        load_scene(lab.configs / "first_light.toml", swaps=("radar=engine_blocks:Swapped",))
    return caught.value.problems


@pytest.mark.parametrize(
    ("acts_on", "hint"),
    [("snr", "did you mean 'SNR'?"), ("Clutter", "did you mean 'clutter'?"), ("warp", "allowed: ")],
)
def test_an_effect_on_no_hook_is_refused_with_the_nearest(lab, monkeypatch, acts_on, hint):
    (problem,) = problems_with(lab, monkeypatch, radar_with(Halves(acts_on)))
    assert problem.key == "blocks.radar.type"
    assert "'halves'" in problem.message and repr(acts_on) in problem.message
    assert hint in problem.message


def test_an_effect_on_a_hook_of_a_base_class_is_called(lab, monkeypatch):
    monkeypatch.setattr(blocks, "Swapped", radar_with(Halves("SNR")), raising=False)
    scene = load_scene(lab.configs / "first_light.toml", swaps=("radar=engine_blocks:Swapped",))
    simulation = Simulation(scene)
    radar = simulation.components["radar"]
    assert [factor(None) for factor in radar.snr_factors][-1] == 0.5
    planned = {item.effect.name for item in simulation.plan if item.built and item.block == "radar"}
    assert {*radar.context.effects} == planned > {"halves"}


@pytest.mark.parametrize(
    ("acts_on", "builds", "said"),
    [("SNR", 0.5, "builds 0.5: SNR needs something to call, (cells) -> factor of each cell's SNR"),
     ("darkness", lambda: True, "darkness needs a value, whether it is too dark to see anything")],
)  # fmt: skip
def test_an_effect_that_builds_what_its_hook_cannot_use_is_named(
    lab, monkeypatch, acts_on, builds, said
):
    effect = Halves(acts_on)
    effect.build = lambda block: builds
    base, name = (ThresholdRadar, "radar") if acts_on == "SNR" else (ElectroOptical, "eo")
    cls = type("Halved", (base,), {"effects": (*base.effects, effect)})
    monkeypatch.setattr(blocks, "Swapped", cls, raising=False)
    scene = load_scene(lab.configs / "first_light.toml", swaps=(f"{name}=engine_blocks:Swapped",))
    with pytest.raises(SceneError) as caught:
        _ = Simulation(scene).components
    (problem,) = caught.value.problems
    assert problem.key == f"blocks.{name}"
    assert problem.message.startswith("effect 'halves' of ") and said in problem.message


@pytest.mark.parametrize("shape", [(3, 1), (1, 7), (9,)])
def test_an_effect_of_another_shape_is_named(lab, monkeypatch, shape):
    effect = Halves("SNR")
    effect.build = lambda block: lambda cells: np.ones(shape)
    monkeypatch.setattr(blocks, "Swapped", radar_with(effect), raising=False)
    scene = load_scene(lab.configs / "first_light.toml", swaps=("radar=engine_blocks:Swapped",))
    with pytest.raises(BlockFailure, match="effect 'halves' gives an array of shape ") as caught:
        Simulation(scene).run()
    assert "radar" in str(caught.value) and str(shape) in str(caught.value)


def test_two_effects_of_one_name_are_refused(lab, monkeypatch):
    # What was built is kept by name: the second would take the place of the first.
    cls = radar_with(Halves("SNR"), Halves("report"))
    (problem,) = problems_with(lab, monkeypatch, cls)
    assert "two effects named 'halves'" in problem.message


def test_every_slip_of_a_scene_is_in_one_report(lab, monkeypatch):
    cls = radar_with(Halves("snr", "one"), Halves("rapport", "two"))
    first, second = problems_with(lab, monkeypatch, cls)
    assert "'one'" in first.message and "'two'" in second.message


def test_a_block_that_asks_for_an_undeclared_hook_is_told_so():
    block = type("Asking", (Relay,), {"hooks": (SNR,)})("a", None, Context(Streams(1)))
    assert block.built("SNR") == []
    with pytest.raises(ValueError, match=r"'snr'.*did you mean 'SNR'"):
        block.built("snr")


@pytest.mark.parametrize("name", entry_points_of())
def test_every_effect_of_a_registered_block_acts_on_a_hook(name):
    cls = find_component(name)
    assert {effect.acts_on for effect in cls.effects} <= set(cls.all_hooks())
    assert all(isinstance(effect.acts_on, Hook) for effect in cls.effects)


@pytest.mark.parametrize("scene", ["first_light", "tracking/cueing"])
def test_what_is_built_can_be_called_as_its_hook_says(lab, scene):
    simulation = Simulation(load_scene(lab.configs / f"{scene}.toml"), simulate_everything=True)
    called = set()
    for block in simulation.components.values():
        for hook in block.all_hooks():
            for built in block.built(hook):
                if getattr(hook.contract, "_is_protocol", False):
                    signature(built).bind(
                        *signature(hook.contract.__call__).parameters.keys() - {"self"}
                    )
                    called.add(hook)
                else:
                    assert isinstance(built, hook.contract)
    assert "SNR" in called


def test_the_description_of_a_block_lists_its_hooks_and_their_effects():
    result = CliRunner().invoke(main, ["components", "radar.swerling"])
    assert result.exit_code == 0
    lines = result.output.splitlines()
    listed = lines[lines.index("hooks, what effects may act on") :]
    (snr,) = [line for line in listed if line.split()[:1] == ["SNR"]]
    assert "(cells) -> factor" in snr and "rain" in snr
    assert any(line.strip().startswith("report") for line in listed)
    plain = CliRunner().invoke(main, ["components", "fusion.pick_best"]).output
    assert "hooks" not in plain
