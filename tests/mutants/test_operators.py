"""Each kind of mutation, and what no mutation touches."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutants.operators import is_valid, mutations

ROOT = Path(__file__).resolve().parents[2]


def mutated(source: str) -> list[tuple[str, str]]:
    """Kinds and sources of the valid mutants of a source."""
    encoded = source.encode()
    found = [one for one in mutations("x.py", encoded) if is_valid(one, encoded)]
    return [(one.kind, one.apply(encoded).decode()) for one in found]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("y = γ + (b)", [("arithmetic", "y = γ - (b)")]),
        ("y = a ** b", [("arithmetic", "y = a * b")]),
        ("y = -a", [("arithmetic", "y = a")]),
        ("y -= a", [("arithmetic", "y += a")]),
        ("y = (a) < b", [("comparison", "y = (a) <= b"), ("comparison", "y = (a) >= b")]),
        ("y = a is not b", [("comparison", "y = a is b")]),
        ("y = a in b", [("comparison", "y = a not in b")]),
        ("y = 3", [("constant", "y = 4")]),
        ("y = 0.0", [("constant", "y = 1.0")]),
        ("y = 0.25", [("constant", "y = 0.5")]),
        ("y = True", [("boolean", "y = False")]),
        ("y = a and b or c", [("boolean", "y = a or b or c"), ("boolean", "y = a and b and c")]),
        ("y = not a", [("boolean", "y = (a)")]),
        ("y = a if b else c", [("boolean", "y = a if (not (b)) else c")]),
        ("f(a, b)", [("argument", "f(a)")]),
        ("f(a, (b), c=d)", [("argument", "f(a, c=d)"), ("argument", "f(a, (b))")]),
        ("f(c=d, *a)", [("argument", "f( *a)")]),
        ("f(c=d)", [("argument", "f()")]),
    ],
)
def test_each_kind_edits_its_place(source: str, expected: list[tuple[str, str]]) -> None:
    assert sorted(mutated(source)) == sorted(expected)


def test_removed_statements_are_those_that_leave_no_name_missing() -> None:
    source = "def f(x, y):\n    z = g(x)\n    x = g(y)\n    h(x)\n    if x:\n        return z\n    return x\n"
    removed = {one for kind, one in mutated(source) if kind == "statement"}
    assert removed == {source.replace(part, "pass", 1) for part in ("x = g(y)", "h(x)", "return z")}


@pytest.mark.parametrize(
    "source",
    [
        '"""A docstring."""',
        "def f(a: Annotated[int, 3] = b) -> Literal[1]: ...",
        "x: Annotated[int, 3]",
        'y = "a" + b',
        'y = f"{a + 1}"',
        'y = folder / "name"',
        'log.info("started", count=3)',
        'self._log.warning("late", seconds=a - b)',
        "@dataclass(frozen=True)\nclass A: ...",
        "if TYPE_CHECKING:\n    x = 3",
        '__all__ = ["a" + b]',
        'f(a, "text")',
        'f(a, hint=f"{b}")',
        "x = field(repr=False)",
    ],
)
def test_text_types_decorators_and_logs_are_left_alone(source: str) -> None:
    assert mutated(source) == []


def test_mutations_of_the_product_change_one_place_and_nearly_all_are_valid() -> None:
    path = ROOT / "shared/marey/motion/rotations.py"
    source = path.read_bytes()
    found = mutations("rotations.py", source)
    assert len(found) > 200
    for one in found:
        assert source[one.start : one.end].decode() != one.replacement
        assert source.count(b"\n", 0, one.start) == one.line - 1
    sample = found[:: len(found) // 40]
    assert sum(is_valid(one, source) for one in sample) >= 0.95 * len(sample)
