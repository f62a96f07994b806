"""Mutations of a Python source file: one small edit each, of six kinds, found by walking its syntax tree.

No mutation touches strings, annotations, docstrings, decorators, log calls, `__all__`, `if TYPE_CHECKING`, or what a
field says of its representation (`repr=`).
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Literal, TypeAlias

Kind: TypeAlias = Literal["arithmetic", "comparison", "constant", "boolean", "argument", "statement"]
Function: TypeAlias = ast.FunctionDef | ast.AsyncFunctionDef

ARITHMETIC: dict[type[ast.operator], str] = {
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
    ast.FloorDiv: "*",
    ast.Mod: "*",
    ast.Pow: "*",
    ast.BitAnd: "|",
    ast.BitOr: "&",
    ast.BitXor: "&",
    ast.LShift: ">>",
    ast.RShift: "<<",
}
COMPARISON: dict[type[ast.cmpop], tuple[str, ...]] = {
    ast.Lt: ("<=", ">="),
    ast.LtE: ("<", ">"),
    ast.Gt: (">=", "<="),
    ast.GtE: (">", "<"),
    ast.Eq: ("!=",),
    ast.NotEq: ("==",),
    ast.Is: ("is not",),
    ast.IsNot: ("is",),
    ast.In: ("not in",),
    ast.NotIn: ("in",),
}
LOG_METHODS = frozenset({"debug", "info", "warning", "error", "exception", "critical", "log"})


@dataclass(frozen=True)
class Mutation:
    """An edit of one file: `source[start:end] = replacement`, in bytes. `line` counts from 1."""

    path: str
    line: int
    start: int
    end: int
    replacement: str
    kind: Kind

    def apply(self, source: bytes) -> bytes:
        """Return the source with the edit in it."""
        return source[: self.start] + self.replacement.encode() + source[self.end :]


def mutations(path: str, source: bytes) -> list[Mutation]:
    """List the mutations of a file by their place. A few are not valid: see `is_valid`."""
    found = set(_Finder(path, source).visit_all(ast.parse(source)))
    return sorted(found, key=lambda one: (one.start, one.end, one.replacement))


def is_valid(mutation: Mutation, source: bytes) -> bool:
    """Return True if the mutated source compiles, and to another tree than the source's."""
    mutated = mutation.apply(source)
    try:
        compile(mutated, "<mutant>", "exec")
    except SyntaxError:
        return False
    return ast.dump(ast.parse(mutated)) != ast.dump(ast.parse(source))


class _Finder:
    def __init__(self, path: str, source: bytes) -> None:
        self.path = path
        self.source = source
        self.lines = [0, *accumulate(len(line) for line in source.splitlines(keepends=True))]

    def visit_all(self, node: ast.AST) -> Iterator[Mutation]:
        """Mutations of a node and everything below it."""
        if _is_left_alone(node):
            return
        yield from self._of(node)
        for child in _children(node):
            yield from self.visit_all(child)

    def _of(self, node: ast.AST) -> Iterator[Mutation]:
        match node:
            case ast.BinOp() if not _is_text(node.left) and not _is_text(node.right):
                yield from self._operator(node.left, node.right, ARITHMETIC.get(type(node.op)), "arithmetic")
            case ast.AugAssign() if not _is_text(node.value):
                if sign := ARITHMETIC.get(type(node.op)):
                    yield from self._operator(node.target, node.value, f"{sign}=", "arithmetic")
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                yield self._replace(node, self._text(operand), "arithmetic")
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                yield self._replace(node, f"({self._text(operand)})", "boolean")
            case ast.Compare():
                operands = [node.left, *node.comparators]
                for (left, right), sign in zip(pairwise(operands), node.ops, strict=True):
                    for other in COMPARISON[type(sign)]:
                        yield from self._operator(left, right, other, "comparison")
            case ast.BoolOp():
                other = "or" if isinstance(node.op, ast.And) else "and"
                for left, right in pairwise(node.values):
                    yield from self._operator(left, right, other, "boolean")
            case ast.Constant():
                yield from self._constant(node)
            case ast.If() | ast.IfExp() | ast.While():
                yield self._replace(node.test, f"(not ({self._text(node.test)}))", "boolean")
            case ast.Call():
                yield from self._arguments(node)
            case _:
                pass
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from self._statements(node)

    def _constant(self, node: ast.Constant) -> Iterator[Mutation]:
        if isinstance(node.value, bool):
            yield self._replace(node, str(not node.value), "boolean")
        elif isinstance(node.value, int):
            yield self._replace(node, str(node.value + 1), "constant")
        elif isinstance(node.value, float):
            yield self._replace(node, repr(node.value * 2 or 1.0), "constant")

    def _arguments(self, node: ast.Call) -> Iterator[Mutation]:
        """Leave out any named argument, and the last of several positional ones, but no text."""
        given = sorted([*node.args, *node.keywords], key=self._span)
        droppable: list[ast.AST] = [
            each for each in node.keywords if each.arg not in (None, "repr") and not _is_text(each.value)
        ]
        if len(node.args) > 1 and not isinstance(node.args[-1], ast.Starred) and not _is_text(node.args[-1]):
            droppable.append(node.args[-1])
        bounds = [self.source.find(b"(", self._span(node.func)[1])]
        for left, right in pairwise(given):
            bounds.append(self.source.find(b",", self._span(left)[1], self._span(right)[0]))
        bounds.append(self._span(node)[1] - 1)
        for index in map(given.index, droppable):
            start, end = bounds[index : index + 2]
            first, last = index == 0, index == len(given) - 1
            yield self._cut((start + first, end + (first and not last)), "", "argument")

    def _statements(self, function: Function) -> Iterator[Mutation]:
        bound = {argument.arg for argument in ast.walk(function.args) if isinstance(argument, ast.arg)}
        for statement in _own_statements(function):
            if _is_removable(statement, bound, nested=statement not in function.body):
                yield self._replace(statement, "pass", "statement")
            if isinstance(statement, ast.Assign):
                bound.update(target.id for target in statement.targets if isinstance(target, ast.Name))
            elif isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
                bound.add(statement.target.id)

    def _operator(self, left: ast.expr, right: ast.expr, sign: str | None, kind: Kind) -> Iterator[Mutation]:
        """Replace the operator between two operands, and leave their parentheses."""
        if sign is None:
            return
        start, end = self._span(left)[1], self._span(right)[0]
        between = self.source[start:end]
        if b"#" in between or b"\\" in between:
            return
        core = between.strip(b" \t\r\n()")
        offset = between.index(core)
        start += offset
        yield self._cut((start, start + len(core)), sign, kind)

    def _replace(self, node: ast.AST, replacement: str, kind: Kind) -> Mutation:
        return self._cut(self._span(node), replacement, kind)

    def _cut(self, span: tuple[int, int], replacement: str, kind: Kind) -> Mutation:
        start, end = span
        return Mutation(self.path, self.source.count(b"\n", 0, start) + 1, start, end, replacement, kind)

    def _text(self, node: ast.AST) -> str:
        start, end = self._span(node)
        return self.source[start:end].decode()

    def _span(self, node: ast.AST) -> tuple[int, int]:
        """Byte offsets of a node."""
        assert isinstance(node, ast.expr | ast.stmt | ast.keyword)
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = self.lines[node.lineno - 1] + node.col_offset
        return start, self.lines[node.end_lineno - 1] + node.end_col_offset


def _children(node: ast.AST) -> Iterator[ast.AST]:
    """Children of a node without its annotations and decorators."""
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list", "type_params"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield child


def _is_left_alone(node: ast.AST) -> bool:
    match node:
        case ast.JoinedStr() | ast.keyword(arg="repr"):
            return True
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
        case ast.Assign(targets=[ast.Name(id="__all__")]):
            return True
        case ast.Call(func=ast.Attribute(attr=method, value=owner)) if method in LOG_METHODS:
            return "log" in ast.unparse(owner)
        case _:
            return False


def _is_text(node: ast.expr) -> bool:
    match node:
        case ast.JoinedStr() | ast.Constant(value=str() | bytes()):
            return True
        case ast.BinOp(left=left, right=right):
            return _is_text(left) or _is_text(right)
        case _:
            return False


def _own_statements(function: Function) -> Iterator[ast.stmt]:
    """Statements of a function in the order of the source, without those of functions and classes inside it."""

    def below(node: ast.AST) -> Iterator[ast.stmt]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.stmt):
                yield child
            if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda):
                yield from below(child)

    yield from below(function)


def _is_removable(statement: ast.stmt, bound: set[str], *, nested: bool) -> bool:
    match statement:
        case ast.Expr(value=ast.Call() as call):
            return not _is_left_alone(call)
        case ast.Expr(value=ast.Await()):
            return True
        case ast.Assign(targets=targets):
            # A first assignment would be missed by a NameError: it says nothing about the tests.
            return all(not isinstance(target, ast.Name) or target.id in bound for target in targets) and not any(
                isinstance(target, ast.Tuple | ast.List) for target in targets
            )
        case ast.AugAssign() | ast.Raise() | ast.Break() | ast.Continue() | ast.Delete() | ast.Assert():
            return True
        case ast.Return():
            return nested
        case _:
            return False
