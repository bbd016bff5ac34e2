"""Text that came from a file, a name, a path or an argument, made fit to be shown.

A terminal obeys control characters: a name can move the cursor, set the window's title or turn
the text that follows around. `escape_unprintable` writes each of them as an escape, so that what
is shown is what is there.
"""

import os
import shlex
from collections.abc import Iterable

#: Longest value of a scene and longest name that a message, a table or a figure repeats in full.
MOST_OF_A_VALUE = 80
MOST_OF_A_NAME = 60


def escape_unprintable(text: object, *, lines: bool = False) -> str:
    r"""Return `text` with every character that is not plainly visible as an escape.

    Those are Unicode's categories "other" and "separator" but the blank, as in `str.isprintable`:
    they become ``\x1b``, ``\u202e`` or ``\U000e0001``. With `lines` line feeds stay, for text whose
    parts were made printable before.
    """
    plain = _text_of(text)
    if plain.isprintable():
        return plain
    return "".join(
        letter if letter.isprintable() or (lines and letter == "\n") else _escape_character(letter)
        for letter in plain
    )


def shorten(text: object, most: int = MOST_OF_A_NAME) -> str:
    """Return printable text of at most `most` characters; an ellipsis stands for what is cut."""
    plain = _text_of(text)
    # What is cut away need not be escaped: one letter becomes one or more.
    plain = escape_unprintable(plain[: most + 1])
    return plain if len(plain) <= most else plain[: max(0, most - 1)] + "…"


def _text_of(text: object) -> str:
    if type(text) is str:
        return text
    try:
        # A stranger's exception may print itself wrongly, and a subclass may lie of itself.
        return str.__str__(text) if isinstance(text, str) else str(text)
    except Exception:
        return f"<{type(text).__name__}>"


def _escape_character(letter: str) -> str:
    code = ord(letter)
    if letter in "\n\r\t":
        return {"\n": r"\n", "\r": r"\r", "\t": r"\t"}[letter]
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def shell_line(words: Iterable[str]) -> str:
    """Return words joined and quoted, so that a shell reads back the same words."""
    return " ".join(map(_quote_for_shell, words))


def _quote_for_shell(word: str) -> str:
    """Return a word quoted for a shell, with unprintable characters as octal escapes."""
    if word.isprintable():
        return shlex.quote(word)
    plain = word.replace("\\", "\\\\").replace("'", "\\'")
    shown = "".join(
        c if c.isprintable() else "".join(f"\\{b:03o}" for b in os.fsencode(c)) for c in plain
    )
    return f"$'{shown}'"
