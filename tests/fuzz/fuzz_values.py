# ruff: noqa: E501
"""Values that nobody should write into a scene, and some that are merely unusual."""

import random
from typing import Any

NUMBERS = (
    0, 1, -1, 2, 0.5, -0.5, 1e-3, 1e-9, 1e-12, 1e-15, 1e-30, 1e-31, 1e-300, 1e-320, 5e-324, -5e-324,
    1e3, 1e5, 1e6, 1e9, 1e12, 1e15, 1e18, 1e19, 1e30, 1e31, 1e100, 1e154, 1e200, 1e300, 1e308,
    -1e3, -1e6, -1e9, -1e12, -1e30, -1e154, -1e200, -1e308, 0.1, 0.999999999999, 1.0000001,
    90, -90, 90.0000001, 180, -180, 360, -360, 1e4, 89.99999999, 179.9999999, 2**31, 2**53, 2**62,
    2**63 - 1, 2**63, 2**64, -(2**63), 10**20, 10**99, 10**100, 10**400, float("nan"),
    float("inf"), float("-inf"), -0.0, 273.15, 6378137.0, 4.6e9, 4.7e9,
)  # fmt: skip

TEXTS = (
    "", " ", "\0", "a\0b", "x" * 300, "x" * 5000, "/" * 5000, "~", "~nosuchuser/x", "~10 runs", "..",
    ".", "/", "/dev/zero", "/dev/stdin", "/dev/null", "/proc/self/mem", "/etc", "fifo", "loop",
    "*", "?", "[", "[/]", "[bold]", "$x^{$", "a*b?", "%s%n", "{0}", "\\", "'", '"', "\n", "\r\n",
    "\x1b[2J", "\x9b31m", "\x7f", "\u202e", "\ud7ff", "é", "漢字", "🛩", "nan", "inf", "-inf",
    "1e400",     "1e99999999", "1e-9999999", "1/0", "0/1", "1/3", "30000/1001", "1_000", "0x10", "9" * 5000,
    "1/" + "9" * 5000, "1 scan", "0 scans", "-1 scans", "1e3 scans", "10000000000000000000 scans",
    "٣ scans", "1000000 scans", "true", "None", "null", "2024-01-01", "radar.swerling", "nothing",
    "no.such", "os:system", "json:loads", ":", "a:", ":b", "dsa_des.block.component:Component",
)  # fmt: skip

#: What stands for a value in TOML and is none of its kinds, or one in a great many pieces.
RAW = (
    "", "[", "]", "{", "}", "{}", "[]", "[[]]", "[" * 3000, "{a=" * 2000, "[" * 60 + "]" * 60,
    "{a=" * 70 + "1" + "}" * 70, "9" * 5000, "-" + "9" * 4299, "0x" + "f" * 5000, "0b" + "1" * 9,
    "1e400", "-1e400", "nan", "+inf", "1_0", "01", "1979-05-27T07:32:00Z", "07:32:00", "true",
    "tru",     "'''", '"""', '"a', "'a'", '"\\u0000"', '"\\ud800"', "1 = 2", "1\nseed = 3", "# none",
    '{extends = "scene.toml"}', '{extends = "missing.toml"}', '{extends = ["a.toml", 3]}',
    '["' + "x" * 4000 + '"]', "[1, 'a', {b = 2}]", "[1, 2]", "[0, 0, 0]", "[nan, 1e308, 1e-320]",
    "{a = 1, a = 2}", "[" + "1," * 5000 + "]",
)  # fmt: skip


def number(rng: random.Random) -> Any:
    """Return a number: one of the list, a small change of it, or one of any size."""
    kind = rng.random()
    if kind < 0.3:
        return rng.choice(NUMBERS)
    if kind < 0.5:
        return rng.choice((1, 1, -1)) * 10.0 ** rng.randint(-30, 30)
    if kind < 0.7:
        return rng.choice((1, 1, 1, -1)) * 10 ** rng.uniform(-6, 6)
    if kind < 0.9:
        return plausible(rng)
    return rng.choice((-1, 1)) * 10 ** rng.uniform(-310, 308)


def plausible(rng: random.Random) -> Any:
    """Return a number that a scene may well hold."""
    return rng.choice((rng.uniform(-1, 1), rng.uniform(0, 1), rng.uniform(0, 100),
                       rng.randint(0, 9), rng.uniform(-400, 400), rng.uniform(0, 3e4)))  # fmt: skip


def value(rng: random.Random, depth: int = 0) -> Any:
    """Return a value of any kind."""
    kind = rng.random()
    if kind < 0.5:
        return number(rng)
    if kind < 0.65:
        return plausible(rng)
    if kind < 0.85 or depth > 3:
        return rng.choice(TEXTS)
    if kind < 0.88:
        return rng.random() < 0.5
    if kind < 0.95:
        return [value(rng, depth + 1) for _ in range(rng.choice((0, 1, 2, 3, 3, 7)))]
    return {rng.choice(("a", "from", "kind", "", "x.y")): value(rng, depth + 1)}


def raw(rng: random.Random) -> str:
    """Return TOML for a value: well formed, or not."""
    from dsa_des.files.toml_files import inline_toml

    return rng.choice(RAW) if rng.random() < 0.3 else inline_toml(value(rng))
