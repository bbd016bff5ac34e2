"""Text that is shown holds nothing that a terminal obeys."""

import io
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.table import Table
from rich.text import Text

from dsa_des.errors import Problem, SceneError, UsageError
from dsa_des.terminal.safe_console import SafeConsole
from dsa_des.text.safe_text import escape_unprintable, shorten

HOSTILE = "\x1b[31m\x07\x08\r\n\t\x7f\x85\x9b\u200b\u2028\u202e\u2066\ud800\U000e0001"
ANY_TEXT = st.text(st.characters())


def bad_letters(text: str, allowed: str = "") -> set[str]:
    return {
        letter
        for letter in text
        if unicodedata.category(letter) in ("Cc", "Cf", "Cs", "Co", "Zl", "Zp")
        and letter not in allowed
    }


@given(ANY_TEXT)
def test_nothing_printed_has_a_control_format_or_surrogate_letter(text: str) -> None:
    shown = escape_unprintable(text)
    assert not bad_letters(shown)
    assert escape_unprintable(shown) == shown


@given(ANY_TEXT)
def test_what_is_plain_is_left_alone(text: str) -> None:
    plain = "".join(letter for letter in text if letter.isprintable())
    assert escape_unprintable(plain) == plain


@given(ANY_TEXT, st.integers(2, 40))
def test_shortened_text_is_short_and_says_so(text: str, most: int) -> None:
    shown = shorten(text, most)
    assert len(shown) <= most
    assert shown == escape_unprintable(text) or shown.endswith("…")


def test_escapes_name_their_letters() -> None:
    assert escape_unprintable("\x1b\u202e\U000e0001\n") == r"\x1b\u202e\U000e0001\n"


@given(ANY_TEXT, ANY_TEXT, ANY_TEXT)
def test_a_problem_is_one_line_whatever_is_in_it(file: str, key: str, message: str) -> None:
    error = SceneError([Problem(file, key, message, file), Problem(file, key, message)])
    lines = str(error).split("\n")
    assert len(lines) == 3
    assert not any(bad_letters(line) for line in lines)
    assert not bad_letters(str(UsageError(message)))


@pytest.mark.parametrize("text", [HOSTILE, "[/]", "[bold]x[/bold]", ":smile:", "[link=x]"])
def test_a_console_prints_text_and_nothing_else(text: str) -> None:
    stream = io.StringIO()
    console = SafeConsole(file=stream, width=400, force_terminal=False)
    table = Table(title=text)
    table.add_column(text)
    table.add_row(text)
    table.add_row(Text(text))
    console.print(text)
    console.print(table)
    shown = stream.getvalue()
    assert not bad_letters(shown, "\n")
    assert shown.count(escape_unprintable(text)) >= 3
    assert "\n\n" not in console.render_str(HOSTILE).plain


def test_a_stream_that_knows_few_letters_gets_escapes(capfd: pytest.CaptureFixture[str]) -> None:
    import subprocess
    import sys

    script = (
        "from dsa_des.terminal.terminal import say, console\n"
        "say('µ é \\u6f22')\nconsole(80).print('µ \\u6f22')"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True,
        env={**__import__("os").environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"},
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [r"\xb5 \xe9 \u6f22", r"\xb5 \u6f22"]


def test_help_for_want_of_a_command_keeps_its_lines(capsys: pytest.CaptureFixture[str]) -> None:
    from dsa_des.cli import main

    for words in ([], ["encounters"]):
        with pytest.raises(SystemExit):
            main(words)
        said = "".join(capsys.readouterr())
        assert "\n  -h, --help" in said and "\\n" not in said, said
