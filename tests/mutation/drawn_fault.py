"""Every small mistake that could be made in a file, found in its syntax tree."""

import ast
import copy
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import unified_diff
from hashlib import sha256
from itertools import chain, pairwise

from definitions import spliced

_COMPARED = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt), ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
_CALCULATED = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd, ast.FloorDiv: ast.Mult, ast.Mod: ast.FloorDiv, ast.Pow: ast.Mult,
}  # fmt: skip
_TERMS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
_PAIRS = [
    ("min", "max"), ("minimum", "maximum"), ("sin", "cos"), ("arcsin", "arccos"), ("asin", "acos"),
    ("floor", "ceil"), ("any", "all"), ("argmin", "argmax"), ("nanmin", "nanmax"),
    ("degrees", "radians"), ("deg2rad", "rad2deg"), ("mean", "median"), ("sum", "max"),
    ("zeros", "ones"), ("fmin", "fmax"), ("logical_and", "logical_or"),
]  # fmt: skip
_ALIKE = {a: b for pair in _PAIRS for a, b in (pair, pair[::-1])}
_LEFT_OUT = {
    "abs",
    "sqrt",
    "radians",
    "degrees",
    "exp",
    "log10",
    "log",
    "sorted",
    "round",
    "wrap_pi",
}
#: Of these the order of arguments does not matter (but to NaN, in Python's own `min` and `max`).
_EITHER_WAY = {
    "min", "max", "minimum", "maximum", "fmin", "fmax", "hypot", "gcd", "lcm", "array_equal",
    "logical_and", "logical_or", "logical_xor", "union1d", "np.add", "np.multiply",
}  # fmt: skip
#: Keywords that say what is so without them, or what only saves memory.
_NEEDLESS = {
    ("dumps", "ensure_ascii=True"), ("searchsorted", "side='left'"), ("unique", "axis=None"),
    ("fromiter", "count"), *((name, f"dtype={of}") for of in ("np.float64", "float")
                             for name in ("zeros", "ones", "empty", "linspace")),
}  # fmt: skip
_DEFINED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


@dataclass(frozen=True, eq=False)
class DrawnFault:
    """A mistake at one place of a file.

    Attributes
    ----------
    file : str
        Path from the root of the project.
    where : str
        Class, function and, where functions are nested, the inner one; empty for the module itself.
    operator : str
        What kind of mistake.
    ordinal : int
        Which of this kind within `where`, from 0.
    old, new : ast.AST
        What stands there, and what takes its place.
    written : ast.AST
        What is written anew: `old`, or the text with values in it that `old` stands in, since
        Python 3.11 does not say where in such a text a value stands.
    text : str
        The file without the mistake.
    """

    file: str
    where: str
    operator: str
    ordinal: int
    old: ast.AST
    new: ast.AST
    written: ast.AST
    text: str

    @property
    def name(self) -> str:
        """Return what it is known by as long as nothing before it in its function changes."""
        return f"{self.file}::{self.where}::{self.operator}::{self.ordinal}"

    @property
    def room(self) -> str:
        """Return the package that it lies in."""
        return "/".join(self.file.split("/")[:2]) if self.file.count("/") > 1 else "dsa_des"

    @property
    def line(self) -> int:
        """Return the number of its line."""
        return self.old.lineno

    @property
    def change(self) -> str:
        """Return what stands there and what takes its place, each on one line."""
        return f"{_short(self.old)}  →  {_short(self.new)}"

    @property
    def digest(self) -> str:
        """Return a text that changes when the fault does."""
        return self.digest_of(self.name, self.change)

    @staticmethod
    def digest_of(name: str, change: str) -> str:
        """Return the digest of a fault of this name and change, in whatever file it stands."""
        return sha256(f"{name.partition('::')[2]}\0{change}".encode()).hexdigest()[:16]

    def applied(self) -> str:
        """Return the text of the file with the mistake in it.

        Raises
        ------
        ValueError
            If that is no Python, or the same.
        """
        there = self.written
        text = ast.unparse(_replaced(there, self.old, self.new))
        if isinstance(there, ast.BinOp | ast.BoolOp | ast.Compare | ast.UnaryOp | ast.IfExp):
            text = f"({text})"  # what takes its place may bind less
        source = spliced(self.text, there, there, text)
        with warnings.catch_warnings(action="ignore"):
            try:
                tree = ast.parse(source)
                compile(tree, self.file, "exec")
            except SyntaxError as error:
                raise ValueError(f"{self.name}: {error}") from None
        if ast.dump(tree) == ast.dump(ast.parse(self.text)):
            raise ValueError(f"{self.name}: the same")
        return source

    def difference(self) -> str:
        """Return the lines before and after."""
        after = self.applied().splitlines()
        lines = list(unified_diff(self.text.splitlines(), after, n=0, lineterm=""))[2:]
        return "\n".join(line for line in lines if not line.startswith("@@"))


def faults_of(file: str, text: str) -> list[DrawnFault]:
    """Return all of them, in the order of the file.

    Declarations are left out: docstrings, annotations, decorators, imports, what classes declare
    outside their methods, texts, and what is raised. So is what is the same by the meaning of a
    function: its arguments in another order, or a keyword that says its default.
    """
    found: list[DrawnFault] = []
    counts: Counter[tuple[str, str]] = Counter()
    for where, node, within in _places(ast.parse(text)):
        for operator, old, new in _mistakes(node):
            place = (where, operator)
            found.append(
                DrawnFault(file, where, operator, counts[place], old, new, within or old, text)
            )
            counts[place] += 1
    return found


def _short(node: ast.AST) -> str:
    text = " ".join(ast.unparse(node).split())
    return text if len(text) <= 70 else f"{text[:34]} … {text[-34:]}"


def _replaced(node: ast.AST, old: ast.AST, new: ast.AST) -> ast.AST:
    """Return the tree below a node with one node replaced; the tree itself stays."""
    if node is old:
        return new
    fields = {}
    for field, value in ast.iter_fields(node):
        if isinstance(value, list):
            fields[field] = [_replaced(v, old, new) if isinstance(v, ast.AST) else v for v in value]
        else:
            fields[field] = _replaced(value, old, new) if isinstance(value, ast.AST) else value
    return type(node)(**fields)


def _places(
    node: ast.AST, where: str = "", within: ast.AST | None = None
) -> Iterator[tuple[str, ast.AST, ast.AST | None]]:
    """Yield where a node lies, the node, and the text with values in it that it stands in."""
    parts: Iterable[ast.AST] = ast.iter_child_nodes(node)
    match node:
        case ast.ClassDef():
            parts = [each for each in node.body if isinstance(each, _DEFINED)]
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            parts = [*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body]
        case ast.Raise() | ast.Import() | ast.ImportFrom() | ast.Assert():
            return
        case ast.Expr(value=ast.Constant()):  # a docstring
            return
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return
        case ast.Assign(targets=[ast.Name(id="__all__")]):
            return
        case ast.keyword(arg="strict"):
            return
        case ast.AnnAssign():
            parts = [node.value] if node.value is not None else []
        case ast.JoinedStr():
            within = within or node
    if isinstance(node, _DEFINED):
        where = f"{where}.{node.name}".lstrip(".")
    elif hasattr(node, "col_offset"):
        yield where, node, within
    for part in parts:
        yield from _places(part, where, within)


def _mistakes(node: ast.AST) -> Iterator[tuple[str, ast.AST, ast.AST]]:
    """Yield the kinds of mistakes that one node allows, what goes, and what takes its place."""
    if isinstance(node, ast.If | ast.While):
        yield "swapped branches", node.test, ast.UnaryOp(ast.Not(), node.test)
    kinds = (_of_constants, _of_operators, _of_conditions, _of_calls, _of_statements)
    for operator, other in chain.from_iterable(kind(node) for kind in kinds):
        yield operator, node, other


def _of_constants(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    match node:
        case ast.Constant(value=bool(value)):
            yield "true or false", ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield "off by one", ast.Constant(value + 1)
            yield "off by one", ast.Constant(value - 1)
        case ast.Constant(value=float(value)):
            yield "constant", ast.Constant(value * 1.1 if value else 0.1)
            yield "constant", ast.Constant(value * 2.0 if value else 1.0)


def _of_operators(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    match node:
        case ast.BinOp(left=ast.Constant(value=str()) | ast.JoinedStr()):
            return
        case ast.BinOp(left=left, op=op, right=right):
            if type(op) in _CALCULATED:
                yield "arithmetic", _with(node, op=_CALCULATED[type(op)]())
            if isinstance(op, _TERMS):
                yield "dropped term", left
            if isinstance(op, ast.Add | ast.Mult):
                yield "dropped term", right
            if isinstance(op, ast.Sub | ast.Div):
                yield "swapped operands", _with(node, left=right, right=left)
        case ast.AugAssign(op=op) if type(op) in _CALCULATED:
            yield "arithmetic", _with(node, op=_CALCULATED[type(op)]())
        case ast.UnaryOp(op=ast.USub() | ast.Invert(), operand=operand):
            yield "sign", operand


def _of_conditions(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    match node:
        case ast.Compare(ops=ops):
            for k, each in enumerate(ops):
                for kind in _COMPARED[type(each)]:
                    yield "comparison", _with(node, ops=[*ops[:k], kind(), *ops[k + 1 :]])
        case ast.BoolOp(op=op, values=values):
            yield "and, or", _with(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
            for k in range(len(values)):
                rest = [*values[:k], *values[k + 1 :]]
                yield "dropped condition", rest[0] if len(rest) == 1 else _with(node, values=rest)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield "dropped not", operand
        case ast.IfExp(body=body, orelse=orelse):
            yield "swapped branches", _with(node, body=orelse, orelse=body)
        case ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
            for k, part in enumerate(node.generators):
                if part.ifs:
                    parts = [*node.generators]
                    parts[k] = _with(part, ifs=[])
                    yield "dropped filter", _with(node, generators=parts)


def _of_calls(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    if not isinstance(node, ast.Call):
        return
    given, keywords = node.args, node.keywords
    called = ast.unparse(node.func).rpartition(".")[2]
    either_way = bool({called, ast.unparse(node.func)} & _EITHER_WAY) and all(
        each.arg == "out" for each in keywords
    )
    for k, (one, other) in enumerate(pairwise(given)):
        same = ast.dump(one) == ast.dump(other)
        if _is_text(one) != _is_text(other) or either_way or same:
            continue
        swapped = [*given[:k], given[k + 1], given[k], *given[k + 2 :]]
        yield "swapped arguments", _with(node, args=swapped)
    for k, keyword in enumerate(keywords):
        said = (called, keyword.arg), (called, ast.unparse(keyword))
        if keyword.arg not in (None, "strict", "stacklevel") and not _NEEDLESS & {*said}:
            yield "dropped keyword", _with(node, keywords=[*keywords[:k], *keywords[k + 1 :]])
    match node.func:
        case ast.Name(id=name) if name in _ALIKE:
            yield "another function", _with(node, func=_with(node.func, id=_ALIKE[name]))
        case ast.Attribute(attr=name) if name in _ALIKE:
            yield "another function", _with(node, func=_with(node.func, attr=_ALIKE[name]))
    if called in _LEFT_OUT and len(given) == 1:
        yield "dropped function", given[0]


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _of_statements(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    match node:
        case ast.Expr(value=ast.Call()):
            yield "dropped statement", ast.Pass()
        case ast.Continue():
            yield "continue, break", ast.Break()
        case ast.Break():
            yield "continue, break", ast.Continue()


def _with(node: ast.AST, **changed: object) -> ast.AST:
    other = copy.copy(node)
    for field, value in changed.items():
        setattr(other, field, value)
    return other
