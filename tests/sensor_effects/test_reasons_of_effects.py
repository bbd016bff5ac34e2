"""Why an effect is simulated or not, and what its keys cannot be, in words of the scene."""

import pytest

from dsa_des.errors import SceneError
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

BIASED = "[navigation]\nattitude_bias_deg = [1.5, 0, 0]\nposition_bias_m = [30, -20, 5]\n"
RULE = "declare_m = 3\ndeclare_n = 5"
LOOKS_ALONG = "not simulated, it looks along the nose and misalignment_deg is 0"
SENTENCES = [
    ({}, "eo", "background and sun: not simulated, background is 'none'"),
    ({"eo": 'background = "sky"'}, "eo", "background and sun: simulated, background is 'sky'"),
    ({}, "eo", "dynamic signature: not simulated, dynamic_weight is 0"),
    ({"eo": "dynamic_weight = 0.25"}, "eo", "dynamic signature: simulated, dynamic_weight is 0.25"),
    ({}, "ir", "plume: not simulated, plume is false"),
    ({"ir": "plume = true"}, "ir",
     "plume: simulated, plume is true and 'turbofan' has a turbofan"),
    ({"ir": "plume = true", "engines": ("propeller",) * 3}, "ir",
     "plume: not simulated, plume is true, but no target's engine has one"),
    ({}, "ir", "false alarms: not simulated, neither false_alarms nor false_alarms_per_frame is "
     "given"),
    ({"eo": "false_alarms_per_frame = 0.1"}, "eo",
     "false alarms: simulated, false_alarms_per_frame is 0.1"),
    ({"eo": "false_alarms_per_frame = 0.1\nenabled = false"}, "eo",
     "false alarms: not simulated, enabled is false"),
    ({"eo": RULE}, "eo", "declaration: simulated, declare_m is 3 and declare_n is 5"),
    ({}, "radar", "declaration: not simulated, declare_m and declare_n are not given"),
    ({}, "radar", f"mounting: {LOOKS_ALONG}"),
    ({"eo": "mount_azimuth_deg = 30"}, "eo", "mounting: simulated, mount_azimuth_deg is 30"),
    ({"ir": "misalignment_deg = [0, 0.1, 0]"}, "ir",
     "mounting: simulated, misalignment_deg is [0.0, 0.1, 0.0]"),
    *(({}, block, "navigation: not simulated, [navigation] has no bias and no noise")
      for block in ("transform", "eo", "radar")),
    *(({"tables": BIASED}, block,
       "navigation: simulated, [navigation] position_bias_m is [30.0, -20.0, 5.0] and "
       "attitude_bias_deg is [1.5, 0.0, 0.0]") for block in ("transform", "eo", "radar")),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "block", "sentence"), SENTENCES)
def test_a_sentence_says_why(scene, runs, keys, block, sentence):
    assert runs.sentences(scene(**keys), block)[sentence.split(":")[0]] == sentence


def test_what_does_not_apply_does_not_exist(scene):
    simulation = Simulation(load_scene(scene()))
    for name in ("eo", "ir"):
        assert simulation.components[name].context.effects == {}


BAD = [
    ("declare_m = 2", "declare_m and declare_n belong together"),
    ("declare_m = 6\ndeclare_n = 5", "declare_m = 6: it must be at most declare_n, 5"),
    ("declare_m = 0\ndeclare_n = 5", "declare_m"),
    ("mount_elevation_deg = 91", "mount_elevation_deg"),
    ("misalignment_deg = [0, 0]", "misalignment_deg"),
    ("misalignment_deg = [0,50,0]", "misalignment_deg"),
    ("false_alarms_per_frame = -0.1", "false_alarms_per_frame"),
    ("false_alarms_per_frame = 1.5e5", "false_alarms_per_frame"),
    ("[navigation]\nposition_noise_m = [-1, 0, 0]", "position_noise_m"),
    ("[navigation]\nattitude_bias_deg = [0, 0]", "attitude_bias_deg"),
    ("[navigation]\nattitude_noise_deg = [0,31,0]", "attitude_noise_deg"),
]


@pytest.mark.parametrize(("keys", "words"), BAD)
def test_a_bad_value_is_named(scene, keys, words):
    with pytest.raises(SceneError, match=words):
        load_scene(scene(tables=keys) if keys.startswith("[") else scene(keys))
