"""The reason why a text is no TOML, without repeating any of it."""

import re

_PLACE = re.compile(r"(.*) \((at (?:line \d+, column \d+|end of document))\)", re.DOTALL)
# What the parser says with what it found in the text: only the kind of it is told.
_WITH_CONTENT = (
    ("Cannot declare", "a table or key is given twice"),
    ("Cannot mutate", "a table or key is given twice"),
    ("Cannot overwrite", "a table or key is given twice"),
    ("Cannot redefine", "a table or key is given twice"),
    ("Duplicate", "a table or key is given twice"),
    ("Found invalid character", "a character that may not stand there"),
    ("Illegal character", "a character that may not stand there"),
)
_WITHOUT = re.compile(
    r"Expected .{1,60}|Escaped character is .*|Invalid [a-z ]+|Unclosed [a-z ]+|Unterminated "
    r"[a-z ]+|Unescaped '\\' in a string"
)


def toml_reason(error: Exception) -> str:
    """Return what a ``TOMLDecodeError`` says and where, without what stands there.

    A file that is no scene may hold secrets, so it is not quoted.
    """
    found = _PLACE.fullmatch(str(error))
    what, place = (found[1], f" ({found[2]})") if found else (str(error), "")
    for start, told in _WITH_CONTENT:
        if what.startswith(start):
            return told + place
    return (what if _WITHOUT.fullmatch(what) else "something else stands there") + place
