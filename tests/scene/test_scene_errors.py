"""Everything that can be wrong with a scene is one clear message with its place and a way out."""

from pathlib import Path

import pytest

from dsa_des.errors import Problem, SceneError
from dsa_des.scene.scene import load_scene

MODULE = Path(__file__).parents[1] / "support" / "engine_blocks.py"
PULSE = "Pulse; scan_rate_hz = 5"
CHAIN = {"a": PULSE, "b": "Relay", "c": "Relay"}
WIRES = ['"a -> b -> c"']


def only(lab, blocks=CHAIN, wires=WIRES, **load):
    """Return the text of the scene's one problem, without its file."""
    write = {key: load.pop(key) for key in ("duration_s", "seed") if key in load}
    path = lab.write(blocks, wires, **write)
    problems = lab.problems(path, **load)
    assert len(problems) == 1, [str(problem) for problem in problems]
    assert problems[0].source in (str(path), "command line")
    assert str(problems[0]).startswith(f"{problems[0].source}: {problems[0].key}")
    return str(problems[0]).removeprefix(f"{problems[0].source}: ")


@pytest.mark.parametrize(
    ("block", "text"),
    [
        (
            "Pulse; scan_rate_hz = 5; gane = 2",
            "blocks.a.gane: unknown parameter of engine_blocks:Pulse; did you mean 'gain'?",
        ),
        (
            "Pulse; scan_rate_hz = 5; platforms = 2",
            "blocks.a.platforms: unknown parameter of engine_blocks:Pulse; did you mean "
            "'platform'?",
        ),
        (
            "Pulse; scan_rate = 5; scan_rate_hz = 5",
            "blocks.a.scan_rate: unknown parameter of engine_blocks:Pulse; "
            "did you mean 'scan_rate_hz'?",
        ),
        (
            "Pulse",
            "blocks.a.scan_rate_hz: is required by engine_blocks:Pulse and missing",
        ),
        ("Pulse; scan_rate_hz = -5", "blocks.a.scan_rate_hz = -5: must be greater than 0"),
        ("Pulse; scan_rate_hz = 0", "blocks.a.scan_rate_hz = 0: must be greater than 0"),
        (
            "Pulse; scan_rate_hz = 'fast'",
            "blocks.a.scan_rate_hz = 'fast': must be a number or a text such as \"30000/1001\"",
        ),
        (
            "Pulse; scan_rate_hz = true",
            'blocks.a.scan_rate_hz = True: must be a number or a text such as "30000/1001"',
        ),
        (
            "Pulse; scan_rate_hz = 2020-01-01",
            'blocks.a.scan_rate_hz = 2020-01-01: must be a number or a text such as "30000/1001"',
        ),
        ("Pulse; scan_rate_hz = nan", "blocks.a.scan_rate_hz = nan: must be finite"),
        ("Pulse; scan_rate_hz = 5; gain = 'big'", "blocks.a.gain = 'big': must be a number"),
        ("Pulse; scan_rate_hz = 5; gain = '5'", "blocks.a.gain = '5': must be a number"),
        ("Pulse; scan_rate_hz = 5; gain = true", "blocks.a.gain = True: must be a number"),
        ("Pulse; scan_rate_hz = 5; gain = [1]", "blocks.a.gain = [1]: must be a valid number"),
        ("Pulse; scan_rate_hz = 5; gain = inf", "blocks.a.gain = inf: must be a finite number"),
        (
            "Pulse; scan_rate_hz = 5; gain = -0.5",
            "blocks.a.gain = -0.5: must be greater than or equal to 0",
        ),
        (
            "Pulse; scan_rate_hz = 5; offset_s = -1",
            "blocks.a.offset_s = -1: must be greater than or equal to 0",
        ),
        (
            "Pulse; scan_rate_hz = 5; rate_error_ppm = -1000000",
            "blocks.a.rate_error_ppm = '-1000000': must be greater than -1000000: a clock cannot "
            "stand still or run backwards",
        ),
        (
            "Pulse; scan_rate_hz = 1e-30",
            "blocks.a.scan_rate_hz = '1/1000000000000000000000000000000': is too slow: the time "
            "between scans must be below 4.612e+09 s",
        ),
        (
            "Pulse; scan_rate_hz = 5; offset_s = 1e30",
            "blocks.a.offset_s = '1000000000000000000000000000000': must be below 4.612e+09 s",
        ),
        (
            "engine_blocks:Pulze; scan_rate_hz = 5",
            f"blocks.a.type = 'engine_blocks:Pulze': module 'engine_blocks' ({MODULE}) has no "
            "'Pulze'; did you mean 'Pulse'?",
        ),
        (
            "engine_blocks:NotABlock",
            "blocks.a.type = 'engine_blocks:NotABlock': is not a dsa_des.Component",
        ),
        (
            "no_such_module:Radar",
            "blocks.a.type = 'no_such_module:Radar': there is no module 'no_such_module' in the "
            "working directory, in FOLDER or on the Python path",
        ),
        (
            "traffic.skripted",
            "blocks.a.type = 'traffic.skripted': unknown block type; did you mean "
            "'traffic.scripted'? (or module:Class)",
        ),
    ],
)
def test_a_block(lab, block, text):
    assert only(lab, {**CHAIN, "a": block}) == text.replace("FOLDER", str(lab.folder))


@pytest.mark.parametrize(
    ("blocks", "wires", "text"),
    [
        (CHAIN, ['"a -> bb -> c"'], "wires[0]: the scene has no block 'bb'; did you mean 'b'?"),
        (
            CHAIN,
            ['"a.out -> b.inn"', '"b -> c"'],
            "wires[0]: b has no input 'inn'; did you mean 'in'?",
        ),
        (
            CHAIN,
            ['"a.output -> b"', '"b -> c"'],
            "wires[0]: a has no output 'output'; did you mean 'out'?",
        ),
        (
            {"a": PULSE, "n": "NoteSource; scan_rate_hz = 5", "b": "Join"},
            ['"n -> b"', '"a -> b"'],
            "wires[0]: n -> b does not fit: outputs of n: out (Note); inputs of b: in (Beat)",
        ),
        (
            {"a": PULSE, "t": "TwoOutputs", "b": "Relay"},
            ['"a -> t"', '"t -> b"'],
            "wires[1]: t -> b fits in several ways; name the ports: outputs of t: left (Beat), "
            "right (Beat); inputs of b: in (Beat)",
        ),
        (
            {**CHAIN, "d": PULSE},
            [*WIRES, '"d -> c"'],
            "wires: c.in has 2 writers, and takes one: b.out, d.out",
        ),
        (
            {"a": PULSE, "b": "Join"},
            ['"a -> b"', '"a.out -> b.in"'],
            "wires: a.out is wired to b.in more than once",
        ),
        (
            {**CHAIN, "q": "Queuer; scan_rate_hz = 2"},
            [*WIRES, '"c -> q"', '{from = "a", to = "c.inn", delay = "1 scan"}'],
            "wires[2]: c has no input 'inn'; did you mean 'in'?",
        ),
        (
            CHAIN,
            ['"a => b"'],
            'wires[0] = \'a => b\': must read "block -> block" or "block.output -> block.input"',
        ),
        (CHAIN, ["5"], 'wires[0] = 5: must be text such as "gate -> radar", or a table'),
        (
            {"a": PULSE, "b": "Relay"},
            ['{from = "a", too = "b"}'],
            "wires[0]: unknown key 'too'; did you mean 'to'?",
        ),
        (
            {"a": PULSE, "b": "Relay"},
            ['{from = "a", to = "b", delay = "soon"}'],
            'wires[0].delay = \'soon\': must read "1 scan" or "N scans"',
        ),
        (
            {"a": PULSE, "b": "Relay"},
            ['{from = "a", to = "b", delay_s = -1}'],
            "wires[0].delay_s = -1: must be 0 or greater",
        ),
        (
            {**CHAIN, "x": PULSE},
            WIRES,
            "blocks.x: this source is wired to nothing; wire it or remove it",
        ),
        (
            {**CHAIN, "n": "NeverRuns"},
            [*WIRES, '"c -> n"'],
            "blocks.n: would never run: it has no scan clock, no process of its own, and no wire "
            "into a trigger input",
        ),
        (
            {"a": PULSE, "q": "QueuedCue; scan_rate_hz = 5", "b": "Relay"},
            [
                '"a.out -> q.in"',
                '"q -> b"',
                '{from = "b", to = "q.cue", delay_s = 1, holds = {value = 1}}',
            ],
            "wires: b.out -> q.cue: holds must be 'nothing': only a sampled or trigger input with "
            "one writer can hold a message",
        ),
        (
            {"a": PULSE, "q": "Cued; scan_rate_hz = 5", "b": "Relay"},
            ['"a.out -> q.in"', '"q -> b"', '{from = "b.out", to = "q.cue", delay_s = 1}'],
            "wires: b.out -> q.cue is a feedback wire: say what it holds before the first "
            "message (holds = 'nothing' or a table)",
        ),
        (
            {"a": PULSE, "q": "Cued; scan_rate_hz = 5", "b": "Relay"},
            [
                '"a.out -> q.in"',
                '"q -> b"',
                '{from = "b.out", to = "q.cue", delay_s = 1, holds = {worth = 1}}',
            ],
            "wires: b.out -> q.cue: holds: needs value and nothing else",
        ),
        (
            {"a": PULSE, "x": "Join", "y": "Relay", "z": "Relay"},
            ['"a -> x -> y -> z -> x"'],
            "wires: a cycle without delay: x.out -> y.in; y.out -> z.in; z.out -> x.in. Give one "
            'of these wires a delay (delay_s, or delay = "1 scan")',
        ),
        (
            {"d": "Demanded", "b": "Relay"},
            ['"d -> b"'],
            "blocks.d: runs when blocks downstream scan, and none of them has a scan clock",
        ),
    ],
)
def test_wiring(lab, blocks, wires, text):
    assert only(lab, blocks, wires) == text


def test_a_required_input_without_a_wire(lab):
    path = lab.write({**CHAIN, "s": "Sampler; scan_rate_hz = 2"}, WIRES)
    texts = [str(problem) for problem in lab.problems(path)]
    assert texts == [f"{path}: blocks.s: input 'in' (Beat) is required and has no wire"]


def test_each_cause_of_a_missing_wire_is_said_once(lab):
    """A relay without a wire, and what stands behind it: that has its wire and nothing is said."""
    path = lab.write({**CHAIN, "r": "Relay", "s": "Relay"}, [*WIRES, '"r -> s"'])
    texts = [str(problem) for problem in lab.problems(path)]
    assert texts == [f"{path}: blocks.r: input 'in' (Beat) is required and has no wire"]


def test_each_of_two_cycles_is_listed_with_its_own_hops(lab):
    blocks = {"a": PULSE, "p": "Join", "q": "Relay", "x": "Join", "y": "Relay"}
    path = lab.write(blocks, ['"a -> p -> q -> p"', '"q -> x -> y -> x"'])
    texts = [str(problem) for problem in lab.problems(path)]
    assert len(texts) == 2
    assert any("p.out -> q.in; q.out -> p.in." in text for text in texts)
    assert any("x.out -> y.in; y.out -> x.in." in text for text in texts)


def test_a_cycle_names_the_wire_without_delay(lab):
    blocks = {"a": PULSE, "t": "TwoOutputs", "j": "Join", "k": "Relay"}
    wires = [
        '"a -> j -> k -> t"',
        '{from = "t.left", to = "j.in", delay_s = 1, holds = "nothing"}',
        '"t.right -> j.in"',
    ]
    assert "t.right -> j.in" in only(lab, blocks, wires)


def test_a_type_that_cannot_be_judged_does_not_blame_its_neighbours(lab):
    assert only(lab, {**CHAIN, "b": "traffic.nothing_like_it_at_all"}).startswith(
        "blocks.b.type = "
    )


@pytest.mark.parametrize(
    ("load", "text"),
    [
        (
            {"sets": ["blocks.a.gane=2"]},
            "blocks.a.gane: unknown parameter of engine_blocks:Pulse; did you mean 'gain'?",
        ),
        (
            {"sets": ["blocks.aa.gain=2"]},
            "blocks.aa.gain: the scene has no block 'aa'; did you mean 'a'?",
        ),
        ({"sets": ["blocks.a.gain"]}, "--set = 'blocks.a.gain': must have the form KEY=VALUE"),
        ({"sets": ["=3"]}, "--set = '=3': must have the form KEY=VALUE"),
        (
            {"sets": ["blocks.a.scan_rate_hz=-2"]},
            "blocks.a.scan_rate_hz = -2: must be greater than 0",
        ),
        (
            {"sets": ["blocks.a.scan_rate_hz.x=1"]},
            "blocks.a.scan_rate_hz.x: blocks.a.scan_rate_hz is no table",
        ),
        (
            {"sets": ["wires[7]='a -> b'"]},
            "wires[7]: there is no item '7': the list has 1 (from 0)",
        ),
        ({"sets": ["titel=x"]}, "titel: unknown key of a scene; did you mean 'title'?"),
        ({"swaps": ["a"]}, "--swap = 'a': must have the form BLOCK=TYPE"),
        (
            {"swaps": ["x=engine_blocks:Pulse"]},
            "--swap = 'x': the scene has no such block; allowed: a, b, c",
        ),
        (
            {"swaps": ["a=engine_blocks:Pulze"]},
            "--swap a = 'engine_blocks:Pulze': module "
            f"'engine_blocks' ({MODULE}) has no 'Pulze'; did you mean 'Pulse'?",
        ),
        ({"seed": -1}, "seed = -1: must be a whole number from 0 to 9223372036854775807"),
    ],
)
def test_the_command_line(lab, load, text):
    path = lab.write(CHAIN, WIRES)
    problems = lab.problems(path, **load)
    assert [problem.source for problem in problems] == ["command line"]
    assert str(problems[0]) == f"command line: {text}"


@pytest.mark.parametrize("duration", [0, -1, "later", float("nan"), 1e12])
def test_a_duration_that_cannot_be(lab, duration):
    problems = lab.problems(lab.write(CHAIN, WIRES), duration_s=duration)
    assert [problem.key for problem in problems] == ["duration_s"]
    assert "must be" in str(problems[0])


def test_clocks_without_a_common_tick(lab):
    blocks = {
        "a": "Pulse; scan_rate_hz = 1000003.1234567",
        "b": "Pulse; scan_rate_hz = 999983.7654321",
        "end": "Join",
    }
    text = only(lab, blocks, ['"a -> end"', '"b -> end"'])
    assert "no common tick that fits 64 bits" in text
    assert "fewer digits" in text


def test_all_problems_come_at_once(lab):
    path = lab.write({**CHAIN, "a": "Pulse; scan_rate_hz = -1; gane = 2; jitter_s = -1"}, WIRES)
    with pytest.raises(SceneError) as caught:
        load_scene(path, sets=["blocks.c.gain=1", "colour=3"], seed=-4, duration_s=0)
    text = str(caught.value)
    assert text.startswith("7 problems:\n")
    for key in (
        "scan_rate_hz",
        "gane",
        "jitter_s",
        "blocks.c.gain",
        "colour",
        "seed",
        "duration_s",
    ):
        assert key in text


def test_a_swap_keeps_what_the_new_type_knows_and_lists_the_rest(lab):
    path = lab.write({**CHAIN, "a": "Pulse; scan_rate_hz = 5; gain = 2"}, WIRES)
    scene = load_scene(path, swaps=["a=engine_blocks:OwnSource"])
    assert scene.dropped == ["blocks.a.gain", "blocks.a.scan_rate_hz"]
    scene = load_scene(path, swaps=["a=engine_blocks:LoudPulse"], sets=["blocks.a.gain=3"])
    assert scene.dropped == []
    assert scene.blocks["a"].parameters.gain == 3


def test_a_swap_to_a_block_that_does_not_fit_the_wires(lab):
    path = lab.write(CHAIN, WIRES)
    problems = lab.problems(path, swaps=["a=engine_blocks:NoteSource"])
    assert len(problems) == 1 and "does not fit" in str(problems[0])


# -- files ---------------------------------------------------------------------------------------


def files(lab, **texts):
    for name, text in texts.items():
        (lab.folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return lab.folder


def message(path):
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    return str(caught.value)


def test_a_missing_scene(lab):
    folder = files(lab, first_light="")
    assert message(folder / "frist_light.toml") == (
        f"{folder / 'frist_light.toml'}: there is no such file; "
        f"did you mean {folder / 'first_light.toml'}?"
    )
    assert "there is no folder" in message(folder / "nowhere" / "x.toml")
    assert message(folder) == f"{folder}: is a folder; a TOML file is needed"


def test_what_is_no_toml(lab):
    folder = files(lab, broken="blocks = [\n", empty="")
    assert "broken.toml: is not valid TOML: " in message(folder / "broken.toml")
    assert "a scene needs at least one block" in message(folder / "empty.toml")
    (folder / "binary.toml").write_bytes(b"\xff\xfe\x00")
    assert "is not a text file in UTF-8" in message(folder / "binary.toml")


def test_a_missing_base_names_the_file_that_wants_it(lab):
    folder = files(lab, base="", scene='[blocks.a]\nextends = "bse.toml"\n')
    text = message(folder / "scene.toml")
    assert text == (
        f"{folder / 'scene.toml'}: blocks.a.extends: there is no file {folder / 'bse.toml'}; "
        f"did you mean {folder / 'base.toml'}?"
    )


def test_files_that_extend_each_other(lab):
    folder = files(lab, a='extends = "b.toml"', b='extends = "a.toml"', c='extends = "c.toml"')
    assert "extends itself by way of" in message(folder / "a.toml")
    assert "extends itself by way of" in message(folder / "c.toml")


@pytest.mark.parametrize("value", ["5", "[5]", "{x = 1}", "true"])
def test_extends_must_name_files(lab, value):
    folder = files(lab, scene=f"extends = {value}")
    assert "extends = " in message(folder / "scene.toml")
    assert "must be a file name" in message(folder / "scene.toml")


def test_a_problem_names_the_file_that_holds_the_key(lab):
    path = lab.write(CHAIN, WIRES)
    folder = files(lab, top='extends = "scene.toml"\n[blocks.a]\ngain = -1\n')
    assert message(folder / "top.toml").startswith(f"{folder / 'top.toml'}: blocks.a.gain = -1:")
    files(lab, top='extends = "scene.toml"\n[blocks.a]\ngain = 1\n')
    path.write_text(path.read_text(encoding="utf-8").replace("= 5", "= -5"), encoding="utf-8")
    assert message(folder / "top.toml").startswith(f"{path}: blocks.a.scan_rate_hz = -5:")


def test_the_nearer_file_wins(lab):
    lab.write(CHAIN, WIRES)
    folder = files(
        lab,
        middle='extends = "scene.toml"\n[blocks.a]\ngain = 2\nscan_rate_hz = 7\n',
        top='extends = "middle.toml"\nseed = 9\n[blocks.a]\ngain = 3\n',
    )
    scene = load_scene(folder / "top.toml")
    assert scene.blocks["a"].parameters.gain == 3
    assert scene.blocks["a"].parameters.scan_rate_hz == 7
    assert scene.seed == 9


def test_the_resolved_scene_is_the_same_scene(lab):
    import tomllib

    from dsa_des.files.toml_files import to_toml

    blocks = {
        "a": "Pulse; scan_rate_hz = '30000/1001'; offset_s = 0.013; gain = 0.1",
        "q": "Cued; scan_rate_hz = 5",
        "b": "Relay",
    }
    wires = [
        '"a.out -> q.in"',
        '"q -> b"',
        '{from = "b.out", to = "q.cue", delay = "2 scans", holds = {value = 1.5}}',
    ]
    scene = load_scene(lab.write(blocks, wires))
    text = to_toml(scene.resolved())
    (lab.folder / "again.toml").write_text(text, encoding="utf-8")
    again = load_scene(lab.folder / "again.toml")
    assert to_toml(again.resolved()) == text
    assert tomllib.loads(text)["blocks"]["a"]["scan_rate_hz"] == "30000/1001"
    assert lab.run(lab.folder / "again.toml").tables == lab.run(lab.folder / "scene.toml").tables


def test_of_many_problems_twenty_are_listed_and_the_others_counted():
    for count, more in ((2, []), (20, []), (21, ["  and 1 more"]), (30, ["  and 10 more"])):
        problems = [Problem("a.toml", f"key{k}", "must be above 0", -k) for k in range(count)]
        listed = [f"  a.toml: key{k} = {-k}: must be above 0" for k in range(min(count, 20))]
        assert str(SceneError(problems)).split("\n") == [f"{count} problems:", *listed, *more]
    assert str(SceneError(problems[1:2])) == "a.toml: key1 = -1: must be above 0"
