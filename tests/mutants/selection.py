"""The choice of tests that run against a mutant: those that cover its line, within a budget of seconds."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from functools import cached_property, lru_cache
from itertools import chain, zip_longest
from pathlib import Path

from tests.mutants.mapping import LineMap
from tests.mutants.operators import Mutation
from tests.mutants.recording import SOURCES

BUDGET_S = 20.0
"""Seconds that a mutant's tests took when they were recorded: a third of the limit, so that only a hang reaches it."""

WHOLE = {
    "tables.py": "tests/integration/test_migrations.py",
    "config.py": "tests/contracts/test_contracts.py",
    "spec.py": "tests/contracts/test_contracts.py",
}
"""Tests that hold a whole kind of file, by its name, to something else, without a use of any name in it."""
OF_VALUES = frozenset({"ablation.py", "config.py", "spec.py"})
"""Files whose values tests read as a table: those in files of the same name, beside the module's own tests or above."""


class Selector:
    """Choose tests for mutations of a checkout."""

    def __init__(self, root: Path, known: LineMap) -> None:
        self.root = root
        self.map = known

    def select(self, mutation: Mutation) -> list[str]:
        """Return ids of tests, the files nearest by name first; empty if none runs the line."""
        return self._affordable(self._covering(mutation), mutation.path)

    def _covering(self, mutation: Mutation) -> set[str]:
        tree = _parse(self.root / mutation.path)
        chain_of_nodes = _enclosing(tree, mutation.line)
        if chain_of_nodes and isinstance(chain_of_nodes[0], ast.FunctionDef | ast.AsyncFunctionDef):
            found = self.map.covering(mutation.path, _lines_of(tree, mutation.line))
            name = chain_of_nodes[0].name
            if _is_cached(chain_of_nodes[0]):  # recorded for the first test alone that asked
                return found | self._users_of(name)
            if not found and name in _names_at_import(tree):
                return self.map.covering(mutation.path, _runtime_lines(tree))
            # TorchScript and child processes run what nothing traces: tests of its class, of its users, or of files of
            # a similar name stand in.
            return (
                found
                or self._around(chain_of_nodes[1:], mutation.path)
                or self._users_of(name)
                or self._namesakes(mutation.path)
            )
        # The line runs once, when its module is imported: tests that run what uses it stand in.
        if isinstance(chain_of_nodes[0] if chain_of_nodes else None, ast.arguments):
            return self.map.covering(mutation.path, _runtime_lines(chain_of_nodes[1]))
        whole = {name for name, test in self.map.tests.items() if test.passed and _holds(test.file, mutation.path)}
        for names in self._stand_ins(tree, mutation, chain_of_nodes):
            if names:
                return names | whole
        return whole

    def _around(self, nodes: Iterable[ast.AST], path: str) -> set[str]:
        """Tests that run lines of the inmost of these nodes that any test runs."""
        found = (self.map.covering(path, _runtime_lines(node)) for node in nodes)
        return next(filter(None, found), set())

    def _namesakes(self, path: str) -> set[str]:
        """Tests in files that share a word with the name of a file."""
        name = Path(path).name
        return {test for test, record in self.map.tests.items() if record.passed and _nearness(record.file, name)}

    def _stand_ins(self, tree: ast.Module, mutation: Mutation, around: list[ast.AST]) -> Iterator[set[str]]:
        for name in _bound_names(tree, mutation.line):
            yield self._users_of(name)
        for node in [*around, tree]:
            yield self.map.covering(mutation.path, _runtime_lines(node))
        package = str(Path(mutation.path).parent)
        yield set(
            chain.from_iterable(
                self.map.covering(path, self.map.lines[path]) for path in self.map.lines if path.startswith(package)
            )
        )

    def _users_of(self, name: str) -> set[str]:
        """Tests that run a line, inside a function, that names something."""
        return set(chain.from_iterable(self.map.covering(path, lines) for path, lines in self._uses[name].items()))

    @cached_property
    def _uses(self) -> defaultdict[str, dict[str, set[int]]]:
        """Lines inside functions that name something, by name and file."""
        uses: defaultdict[str, dict[str, set[int]]] = defaultdict(dict)
        for path in chain.from_iterable((self.root / source).rglob("*.py") for source in SOURCES):
            file = path.relative_to(self.root).as_posix()
            for node in ast.walk(ast.parse(path.read_bytes())):
                name = getattr(node, "id", None) or getattr(node, "attr", None)
                if name and isinstance(node, ast.Name | ast.Attribute):
                    uses[name].setdefault(file, set()).add(node.lineno)
        return uses

    def _affordable(self, names: set[str], path: str) -> list[str]:
        """Tests within the budget: a quarter of it for the files whose names share the most words with the mutant's, as
        much for all that share one, the rest in turn."""
        by_file: dict[str, list[str]] = defaultdict(list)
        for name in self._one_case_of_each_first(names):
            by_file[self.map.tests[name].file].append(name)
        holding = WHOLE.get(Path(path).name, "")
        near = sorted(by_file, key=lambda file: (file != holding, -_nearness(file, path), file))
        close = [by_file[file] for file in near if _nearness(file, path)]
        chosen = self._take(by_file.get(holding, ()), [], BUDGET_S / 2)
        nearest = [by_file[file] for file in near if _nearness(file, path) == _nearness(near[0], path)]
        chosen = self._take(_in_turn(nearest), chosen, BUDGET_S / 4)
        chosen = self._take(_in_turn(close), chosen, BUDGET_S / 2)
        chosen = self._take(_in_turn(by_file[file] for file in near), chosen, BUDGET_S)
        return sorted(chosen, key=lambda name: (near.index(self.map.tests[name].file), self.map.tests[name].seconds))

    def _one_case_of_each_first(self, names: Iterable[str]) -> list[str]:
        """Sort tests: of each function the quickest case, then the next, for cases of one function notice the same."""
        quick = sorted(names, key=lambda name: (self.map.tests[name].seconds, name))
        cases: Counter[str] = Counter()
        order: dict[str, int] = {}
        for name in quick:
            function = name.partition("[")[0]
            order[name] = cases[function]
            cases[function] += 1
        return sorted(quick, key=order.__getitem__)

    def _take(self, names: Iterable[str], chosen: list[str], budget: float) -> list[str]:
        chosen = list(chosen)
        for name in names:
            if name not in chosen and (not chosen or self.map.cost([*chosen, name]) <= budget):
                chosen.append(name)
        return chosen


def _in_turn(files: Iterable[list[str]]) -> list[str]:
    return [name for names in zip_longest(*files) for name in names if name]


def _holds(test: str, path: str) -> bool:
    """Return True for a file of tests that holds all values of a file of the product."""
    module, file = Path(path), Path(test)
    if test == WHOLE.get(module.name):
        return True
    beside = {"tests", "unit", *module.parent.parts}.issuperset(file.parent.parts)
    return module.name in OF_VALUES and file.name == f"test_{module.name}" and beside


@lru_cache(maxsize=100_000)
def _nearness(test: str, path: str) -> int:
    return len(_words(test) & _words(path))


def _words(path: str) -> set[str]:
    return set(re.split(r"[/_.]", path)) - {"py", "test", "tests", "unit", "marey", "shared", "workers", ""}


@lru_cache(maxsize=64)
def _parse(path: Path) -> ast.Module:
    return ast.parse(path.read_bytes())


def _enclosing(tree: ast.AST, line: int) -> list[ast.AST]:
    """Functions and classes around a line, the inmost first; `arguments` first for a default value of a function."""
    found: list[ast.AST] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            if node.body[0].lineno <= line <= (node.end_lineno or 0):
                found.insert(0, node)
            elif node.lineno <= line < node.body[0].lineno and not isinstance(node, ast.ClassDef):
                return [node.args, node]
    return found


def _is_cached(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    return any("cache" in ast.unparse(decorator) for decorator in function.decorator_list)


def _names_at_import(tree: ast.Module) -> set[str]:
    """Names that a module reads outside functions."""
    inside = {id(node) for each in ast.walk(tree) if isinstance(each, ast.FunctionDef) for node in ast.walk(each)}
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and id(node) not in inside}


def _statement_at(tree: ast.Module, line: int) -> ast.stmt | None:
    inmost: ast.stmt | None = None
    for node in ast.walk(tree):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            inmost = node
    return inmost


def _lines_of(tree: ast.Module, line: int) -> range:
    """Lines of the statement at a line; only the head of one with a body."""
    statement = _statement_at(tree, line)
    if statement is None:
        return range(line, line + 1)
    body: list[ast.stmt] = getattr(statement, "body", [])
    last = max(body[0].lineno - 1, statement.lineno) if body else statement.end_lineno or line
    return range(statement.lineno, last + 1)


def _bound_names(tree: ast.Module, line: int) -> list[str]:
    match _statement_at(tree, line):
        case ast.Assign(targets=targets):
            return [target.id for target in targets if isinstance(target, ast.Name)]
        case ast.AnnAssign(target=ast.Name(id=name)):
            return [name]
        case _:
            return []


def _runtime_lines(node: ast.AST) -> set[int]:
    """Lines in the bodies of the functions of a node."""
    functions = [each for each in ast.walk(node) if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)]
    return {line for each in functions for line in range(each.body[0].lineno, (each.end_lineno or 0) + 1)}
