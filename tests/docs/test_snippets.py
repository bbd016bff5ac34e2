"""Everything that the README and the docs show runs as it is written (`snippets`)."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from snippets import (
    PAGES,
    ROOT,
    SHORTER,
    Snippet,
    file_of,
    not_run,
    read_snippets,
    snippets_of,
)

from dsa_des.cli import main
from tests import warm_process

RUN = [page for page in PAGES if any(not not_run(part) for part in read_snippets(page))]
#: Pages that show what extras do, and the packages that they install.
EXTRAS = {
    "docs/fmu.md": ("fmpy", "pythonfmu3"),
    "docs/formats.md": ("asterix",),
    "docs/stone-soup.md": ("stonesoup",),
}
LEFT = [part for page in PAGES for part in read_snippets(page) if not_run(part)]


#: What only a shell understands.
_SHELL = re.compile(r"[|<>&;$*?`(){}~!#\n\\]")


def run_command(line: str, folder: Path) -> None:
    """Run a line as a shell does that finds this environment's commands."""
    words = shlex.split(line)
    if not _SHELL.search(line) and words[0] in ("dsa-des", "python"):
        own = words[1:] if words[0] == "python" else ["-P", "-m", "dsa_des", *words[1:]]
        forked = warm_process.run(own, cwd=folder)
        assert forked.returncode == 0, f"{line}\n{forked.stdout}\n{forked.stderr}"
        return
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", line],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def play(parts: list[Snippet], folder: Path) -> None:
    """Do what a reader does who follows the page from its top."""
    known: dict[str, object] = {"__name__": "snippet"}
    for part in parts:
        if file := file_of(part):
            place = folder / file[0]
            before = place.read_text(encoding="utf-8") if place.exists() else file[1]
            place.write_text(before + part.text, encoding="utf-8")
    for part in parts:
        if not_run(part) or part.language == "text":
            continue
        if part.language == "sh":
            for line in part.commands():
                run_command(line, folder)
        elif part.language == "python" and not file_of(part):
            exec(compile(part.text, part.place, "exec"), known)
        elif part.language == "toml":
            tomllib.loads(part.text)


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_page_runs_as_written(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in EXTRAS.get(page, ()):
        pytest.importorskip(package, reason=f"{page} needs the package {package}")
    monkeypatch.chdir(tmp_path)  # empty: a reader has what the pages give, and no more
    play(read_snippets(page), tmp_path)


@pytest.mark.parametrize("part", LEFT, ids=lambda part: part.place)
def test_what_is_left_out_has_a_reason(part: Snippet) -> None:
    assert len(not_run(part) or "") > 10
    pytest.skip(f"{part.place} is not run: {not_run(part)}")


def test_only_a_few_blocks_are_left_out() -> None:
    assert len(LEFT) <= 5


@pytest.mark.parametrize("page", PAGES)
def test_every_block_is_of_a_kind_that_is_tested(page: str) -> None:
    for part in read_snippets(page):
        # Of another language only what is written to a file, which a test of its room compiles.
        of_page = ("sh", "python", "toml", "text", *(("cpp",) if file_of(part) else ()))
        assert part.language in of_page, part.place
        if part.language == "sh" and not not_run(part):
            assert list(part.commands()), part.place
            for line in part.commands():
                assert re.match(r"(dsa-des|python|pytest|mkdocs|\S*ruff) ", line), part.place
        assert not part.note or not_run(part) or file_of(part), part.place
    fences = re.findall(r"^```", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    blocks = [part for part in read_snippets(page) if part.text.endswith("\n")]
    assert len(fences) == 2 * len(blocks)


@pytest.mark.parametrize("page", PAGES)
def test_commands_in_running_text_exist_with_their_options(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    context = click.Context(main)
    for words in (" ".join(found.split()) for found in re.findall(r"`(dsa-des [^`]+)`", text)):
        name = words.split()[1]
        if name.startswith("-"):
            continue
        command = main.get_command(context, name)
        assert command is not None, f"{page}: {words}"
        known = {option for item in command.params for option in item.opts}
        options = re.findall(r"(?<=\s)(--[a-z-]+)", words)
        assert set(options) - {"--help"} <= known, f"{page}: {words}"


@pytest.mark.parametrize("page", PAGES)
def test_files_named_in_running_text_exist(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    names = re.findall(r"`((?:tests|components|dsa_des|configs|docs)/[\w./-]+)`", text)
    assert [name for name in names if not (ROOT / name).exists()] == []


def test_the_readme_is_one_screen() -> None:
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 65 and max(map(len, lines)) <= 130


def test_the_reading_finds_notes_and_what_is_shortened() -> None:
    page = (
        "<!-- not run: takes a day -->\n```\nsleep 86400\n```\n"
        "<!-- run: dsa-des check mine.toml -->\n"
        '<!-- file: mine.toml; begins: extends = "a.toml" -->\n```toml\nseed = 1\n```\n'
        "```\ndsa-des study a.toml \\\n  --quiet  # why\n```\n"
    )
    first, hidden, file, last = snippets_of("p.md", page)
    assert not_run(first) == "takes a day" and (first.line, hidden.line) == (1, 5)
    assert list(hidden.commands()) == ["dsa-des check mine.toml"]
    assert file_of(file) == ("mine.toml", 'extends = "a.toml"\n')
    assert [line.split() for line in last.commands()] == [
        ["dsa-des", "study", "a.toml", "--quiet", *SHORTER[0][1].split(), *SHORTER[1][1].split()]
    ]


def test_a_page_that_fails_is_seen(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="unknown_scene"):
        play(snippets_of("p.md", "```\ndsa-des check unknown_scene.toml\n```\n"), tmp_path)
    with pytest.raises(NameError):
        play(snippets_of("p.md", "```python\nnobody_defined_this\n```\n"), tmp_path)


@pytest.mark.parametrize(
    ("page", "command", "block"),
    [
        ("README.md", "run first_light", 0),
        ("docs/tutorial.md", "run mine.toml", 1),
        ("docs/tutorial.md", "study rates.toml --workers 1", 2),
    ],
)
def test_what_a_page_says_a_command_prints_is_printed(
    page: str, command: str, block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    parts = read_snippets(page)
    for part in parts:
        if file := file_of(part):
            Path(file[0]).write_text(file[1] + part.text, encoding="utf-8")
    done = CliRunner().invoke(main, [*command.split(), "--no-figures"])
    printed = [line.rstrip() for line in done.stdout.splitlines()]
    lines = [part.text for part in parts if part.language == "text"][block].splitlines()
    assert lines and all(line.rstrip() in printed for line in lines), lines
