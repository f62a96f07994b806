"""The map from lines of the product to the tests that run them, recorded once and kept in a file.

The map belongs to a commit. It stays good while the product's code does not change; test files that changed since are
recorded anew on their own.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coverage

from tests.mutants.recording import SOURCES

TESTS = ("tests/unit", "tests/models", "tests/integration", "tests/contracts")
"""Acceptance tests run the product in processes of its own, whose lines are not recorded."""
SHARED_TESTS = ("conftest.py", "tests/support", "tests/servers")


@dataclass(frozen=True)
class RecordedTest:
    """A test of the map: its file, its own seconds, and the keys of the wider fixtures that it uses."""

    file: str
    seconds: float
    fixtures: tuple[str, ...]
    passed: bool


class LineMap:
    """Tests by line. Only tests that passed when they were recorded count."""

    def __init__(self, commit: str, tests: dict[str, RecordedTest], fixtures: dict[str, float], lines: Lines) -> None:
        self.commit = commit
        self.tests = tests
        self.fixtures = fixtures
        self.lines = lines
        self._users: dict[str, list[str]] = defaultdict(list)
        for name, test in tests.items():
            for fixture in test.fixtures:
                self._users[fixture].append(name)

    def covering(self, path: str, lines: Iterable[int]) -> set[str]:
        """Ids of the tests that run one of the lines, themselves or in a fixture that they use."""
        of_file = self.lines.get(path, {})
        contexts = {context for line in lines for context in of_file.get(line, ())}
        names = {name for context in contexts for name in (context, *self._users.get(context, ()))}
        return {name for name in names if name in self.tests and self.tests[name].passed}

    def cost(self, names: Iterable[str]) -> float:
        """Seconds that the tests took, with their shared fixtures once."""
        names = list(names)
        fixtures = {fixture for name in names for fixture in self.tests[name].fixtures}
        own = sum(self.tests[name].seconds for name in names)
        return own + sum(self.fixtures.get(fixture, 0.0) for fixture in fixtures)

    def without(self, files: set[str]) -> LineMap:
        """Return the map without the tests of some files."""
        tests = {name: test for name, test in self.tests.items() if test.file not in files}
        return LineMap(self.commit, tests, self.fixtures, self.lines)

    def joined(self, other: LineMap) -> LineMap:
        """Return the tests of both maps, under the other's commit."""
        lines = {path: dict(of_file) for path, of_file in self.lines.items()}
        for path, of_file in other.lines.items():
            mine = lines.setdefault(path, {})
            for line, contexts in of_file.items():
                mine[line] = mine.get(line, frozenset()) | contexts
        return LineMap(other.commit, self.tests | other.tests, self.fixtures | other.fixtures, lines)

    def save(self, path: Path) -> None:
        """Write the map as JSON."""
        contexts = sorted({one for of_file in self.lines.values() for several in of_file.values() for one in several})
        number = {context: index for index, context in enumerate(contexts)}
        lines = {
            file: {str(line): sorted(number[one] for one in several) for line, several in sorted(of_file.items())}
            for file, of_file in sorted(self.lines.items())
        }
        tests = {name: vars(test) for name, test in sorted(self.tests.items())}
        record = {"commit": self.commit, "tests": tests, "fixtures": self.fixtures, "contexts": contexts}
        temporary = path.with_suffix(".new")
        temporary.write_text(json.dumps(record | {"lines": lines}))
        temporary.replace(path)

    @classmethod
    def load(cls, path: Path) -> LineMap:
        """Read what `save` wrote."""
        record = json.loads(path.read_text())
        contexts = record["contexts"]
        lines = {
            file: {int(line): frozenset(contexts[index] for index in several) for line, several in of_file.items()}
            for file, of_file in record["lines"].items()
        }
        return cls(record["commit"], _tests(record["tests"]), record["fixtures"], lines)


Lines = dict[str, dict[int, frozenset[str]]]


def current_map(root: Path, folder: Path, processes: int) -> LineMap:
    """Return the map of the checkout: the kept one, brought up to date, or one recorded now."""
    kept = folder / "map.json"
    known = LineMap.load(kept) if kept.is_file() else None
    if known is None or _changed(root, known.commit, *SOURCES, *SHARED_TESTS):
        result = record_map(root, folder, processes, TESTS)
    else:
        changed = set(_changed(root, known.commit, *TESTS))
        files = sorted(name for name in changed if Path(name).name.startswith("test_") and (root / name).is_file())
        if any(Path(name).name == "conftest.py" for name in changed):
            result = record_map(root, folder, processes, TESTS)
        elif files:
            result = known.without(changed).joined(record_map(root, folder, processes, files))
        else:
            return known.without(changed)
    result.save(kept)
    return result


def record_map(root: Path, folder: Path, processes: int, tests: Sequence[str]) -> LineMap:
    """Run tests with their lines traced, each process a file of tests at a time (0: all in one, for small runs)."""
    part = folder / "part"
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    print(f"recording which lines {', '.join(tests)} run, in {processes} processes", flush=True)
    command = [sys.executable, "-m", "pytest", "-q", "-n", str(processes), "--dist", "loadfile"]
    command += ["-p", "tests.mutants.recording", "-p", "no:cacheprovider", *tests]
    log = folder / "recording.log"
    with log.open("w") as output:
        path = os.pathsep.join(filter(None, [str(root), os.environ.get("PYTHONPATH")]))
        environment = {**os.environ, "MAREY_MUTANTS_PART": str(part), "PYTHONPATH": path}
        code = subprocess.run(command, cwd=root, env=environment, stdout=output, stderr=output, check=False).returncode
    if code not in (0, 1):
        raise SystemExit(f"pytest ended with {code} while it recorded the map: see {log}")
    if code == 1:
        print(f"some tests failed; no mutant runs them: see {log}", flush=True)
    return _read(root, part)


def _read(root: Path, part: Path) -> LineMap:
    tests: dict[str, Any] = {}
    fixtures: dict[str, float] = {}
    for path in sorted(part.glob("*.json")):
        record = json.loads(path.read_text())
        tests |= record["tests"]
        fixtures |= record["fixtures"]
    lines: dict[str, dict[int, frozenset[str]]] = {}
    for path in sorted(part.glob(".coverage.*")):
        data = coverage.CoverageData(str(path))
        data.read()
        for file in data.measured_files():
            of_file = lines.setdefault(Path(file).relative_to(root).as_posix(), {})
            for line, contexts in data.contexts_by_lineno(file).items():
                of_file[line] = of_file.get(line, frozenset()) | frozenset(contexts) - {""}
    return LineMap(_git(root, "rev-parse", "HEAD").strip(), _tests(tests), fixtures, lines)


def _tests(records: dict[str, Any]) -> dict[str, RecordedTest]:
    return {
        name: RecordedTest(one["file"], one["seconds"], tuple(one["fixtures"]), bool(one.get("passed")))
        for name, one in records.items()
        if "file" in one
    }


def _changed(root: Path, commit: str, *paths: str) -> list[str]:
    """Paths that differ between a commit and the working tree, new ones too; all of them if the commit is gone."""
    if subprocess.run(["git", "cat-file", "-e", f"{commit}^{{commit}}"], cwd=root, check=False).returncode:
        return list(paths)
    tracked = _git(root, "diff", "--name-only", "-z", commit, "--", *paths)
    new = _git(root, "ls-files", "-z", "--others", "--exclude-standard", "--", *paths)
    return [name for name in (tracked + new).split("\0") if name]


def _git(root: Path, *arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=root, check=True, capture_output=True, text=True).stdout
