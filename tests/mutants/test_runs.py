"""A small product with tests of its own: recorded, mutated and judged by real processes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.mutants.__main__ import Slot, _Baseline, _judge, _Results
from tests.mutants.drawing import Mutant
from tests.mutants.mapping import LineMap, RecordedTest, current_map, record_map
from tests.mutants.operators import mutations
from tests.mutants.selection import Selector

PRODUCT = "shared/marey/toy.py"
SOURCE = """\
import time
from functools import cache

LIMIT = 10


def at_import():
    return 1


@cache
def known():
    return 5


def asks():
    return known()


ONE = at_import()


def double(x, times=2):
    return x * times


def capped(x):
    return min(x, LIMIT)


def waits(x):
    while not x:
        time.sleep(0.01)
        x = True
    return x


def unused(x):
    return x + 1


class Part:
    def traced(self, x):
        return x

    def compiled(self, x):
        return x * 7
"""
TESTS = """\
import os
import pytest
import shared.marey.toy as toy

@pytest.fixture(scope="module")
def wide():
    return toy.double(3)

def test_wide(wide):
    assert wide == 6

def test_capped():
    assert toy.capped(11) == 10

def test_waits():
    assert toy.waits(False)

def test_asks_first():
    assert toy.asks() == 5

def test_asks_again():
    assert toy.asks() == 5

def test_part():
    assert toy.Part().traced(1) == 1

def test_broken():
    assert toy.capped(0) == 1

def test_only_elsewhere():
    assert toy.double(1) == (99 if "TOY_HERE" in os.environ else 2)
"""


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("toy")
    (root / "shared/marey").mkdir(parents=True)
    (root / PRODUCT).write_text(SOURCE)
    (root / "tests/unit").mkdir(parents=True)
    (root / "tests/unit/test_toy.py").write_text(TESTS)
    (root / "pytest.ini").write_text("[pytest]\naddopts = --import-mode=importlib\npythonpath = .\n")
    (root / ".gitignore").write_text("out/\n__pycache__/\n")
    author = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    for command in (("init", "-q"), ("add", "."), (*author, "commit", "-qm", "toy")):
        subprocess.run(["git", *command], cwd=root, check=True)
    return root


@pytest.fixture(scope="module")
def known(root: Path) -> LineMap:
    return record_map(root, root / "out", 0, ["tests/unit"])


@pytest.fixture(scope="module")
def slot(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Slot]:
    scratch = tmp_path_factory.mktemp("scratch")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_TEST_")}
    environment |= {"MAREY_MUTANTS_SCRATCH": str(scratch), "TOY_HERE": "1", "PYTEST_ADDOPTS": ""}
    with subprocess.Popen(
        [sys.executable, "-m", "tests.mutants.slot", "hypothesis", "schemathesis"],
        cwd=root,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield Slot(process, limit=12)
        assert process.stdin
        process.stdin.close()


def mutant(root: Path, after: str) -> Mutant:
    """The mutant whose changed line reads so."""
    source = (root / PRODUCT).read_bytes()
    mutants = [Mutant("jobs", one, source, one.apply(source)) for one in mutations(PRODUCT, source)]
    return next(one for one in mutants if one.diff[1] == after and one.diff[0] != "time.sleep(0.01)")


def names(*tests: str) -> set[str]:
    return {f"tests/unit/test_toy.py::{test}" for test in tests}


def test_a_line_knows_its_tests_also_those_that_reach_it_by_a_shared_fixture(root: Path, known: LineMap) -> None:
    select = Selector(root, known).select
    assert set(select(mutant(root, "return x / times").mutation)) == names("test_wide", "test_only_elsewhere")


def test_a_line_that_nothing_traces_gets_the_tests_of_files_of_a_similar_name(root: Path, known: LineMap) -> None:
    passed = {name for name, test in known.tests.items() if test.passed}
    assert set(Selector(root, known).select(mutant(root, "return x - 1").mutation)) == passed
    assert names("test_broken").isdisjoint(passed)


def test_a_line_that_runs_on_import_gets_the_tests_of_its_users(root: Path, known: LineMap) -> None:
    select = Selector(root, known).select
    assert set(select(mutant(root, "LIMIT = 11").mutation)) == names("test_capped")
    assert set(select(mutant(root, "def double(x, times=3):").mutation)) == names("test_wide", "test_only_elsewhere")


def test_what_runs_once_gets_the_tests_of_all_that_ask(root: Path, known: LineMap) -> None:
    select = Selector(root, known).select
    assert set(select(mutant(root, "return 6").mutation)) == names("test_asks_first", "test_asks_again")
    assert set(select(mutant(root, "return 2").mutation)) >= names("test_capped", "test_waits")


def test_a_method_that_nothing_traces_gets_the_tests_of_its_class(root: Path, known: LineMap) -> None:
    assert set(Selector(root, known).select(mutant(root, "return x * 8").mutation)) == names("test_part")


def test_a_table_is_held_to_the_migrated_schema(tmp_path: Path) -> None:
    path, file = "shared/marey/toy/tables.py", "tests/integration/test_migrations.py"
    (tmp_path / path).parent.mkdir(parents=True)
    (tmp_path / path).write_text("table = Table(Column(Id, primary_key=True))\n")
    known = LineMap("", {f"{file}::test_same": RecordedTest(file, 1.0, (), passed=True)}, {}, {})
    for mutation in mutations(path, (tmp_path / path).read_bytes()):
        assert Selector(tmp_path, known).select(mutation) == [f"{file}::test_same"]


def test_a_test_of_every_function_comes_before_more_cases_of_one(tmp_path: Path) -> None:
    path, file = "shared/marey/toy/sums.py", "tests/unit/test_sums.py"
    (tmp_path / path).parent.mkdir(parents=True)
    (tmp_path / path).write_text("def add(x):\n    return x + 1\n")
    cases = {f"{file}::test_quick[{n}]": RecordedTest(file, 4.0 + n / 8, (), passed=True) for n in range(5)}
    tests = {**cases, f"{file}::test_slow": RecordedTest(file, 9.0, (), passed=True)}
    known = LineMap("", tests, {}, {path: {2: sorted(tests)}})
    (mutation,) = (each for each in mutations(path, (tmp_path / path).read_bytes()) if each.kind == "arithmetic")
    chosen = Selector(tmp_path, known).select(mutation)
    assert chosen == [f"{file}::test_quick[0]", f"{file}::test_quick[1]", f"{file}::test_slow"]


def test_values_of_a_configuration_are_held_by_tests_of_its_name_beside_those_of_its_module(tmp_path: Path) -> None:
    path = "workers/marey/models/dancer/config.py"
    (tmp_path / path).parent.mkdir(parents=True)
    (tmp_path / path).write_text("SMALL = Config(width=32)\n")
    files = ["tests/models/test_config.py", "tests/models/dancer/test_config.py", "tests/contracts/test_contracts.py"]
    others = ["tests/models/singer/test_config.py", "tests/models/dancer/test_model.py"]
    tests = {f"{file}::test_same": RecordedTest(file, 1.0, (), passed=True) for file in files + others}
    select = Selector(tmp_path, LineMap("", tests, {}, {})).select
    for mutation in mutations(path, (tmp_path / path).read_bytes()):
        assert set(select(mutation)) == {f"{file}::test_same" for file in files}


def test_the_map_is_read_as_it_was_written(tmp_path: Path, known: LineMap) -> None:
    known.save(tmp_path / "map.json")
    again = LineMap.load(tmp_path / "map.json")
    assert vars(again) == vars(known)


@pytest.mark.slow  # of a tool of developers
def test_mutants_are_judged_by_tests_that_pass_without_them(root: Path, slot: Slot, tmp_path: Path) -> None:
    passes = _Baseline(tmp_path / "baseline.json", root)

    def judge(after: str, *tests: str) -> tuple[str, str | None]:
        answer = _judge(slot, mutant(root, after), sorted(names(*tests)), passes)
        return answer["verdict"], answer["by"]

    capped = "tests/unit/test_toy.py::test_capped"
    assert judge("LIMIT = 11", "test_capped", "test_waits") == ("killed", capped)
    assert judge("return x + 2", "test_capped") == ("survived", None)
    assert judge("pass", "test_waits") == ("timeout", None)
    # It fails here without a mutant too, so it kills none.
    assert judge("return x + 2", "test_only_elsewhere", "test_wide") == ("survived", None)
    assert (root / PRODUCT).read_text() == SOURCE


@pytest.mark.slow  # of a tool of developers
def test_a_new_file_of_tests_is_recorded_on_its_own(root: Path, known: LineMap) -> None:
    known.save(root / "out/map.json")
    new = root / "tests/unit/test_new.py"
    new.write_text("import shared.marey.toy as toy\n\ndef test_unused():\n    assert toy.unused(1) == 2\n")
    try:
        updated = current_map(root, root / "out", 0)
    finally:
        new.unlink()
    lines = {text.strip(): number for number, text in enumerate(SOURCE.splitlines(), 1)}
    assert updated.covering(PRODUCT, [lines["return x + 1"]]) == {"tests/unit/test_new.py::test_unused"}
    assert updated.covering(PRODUCT, [lines["return min(x, LIMIT)"]]) == names("test_capped")
    assert len(updated.tests) == len(known.tests) + 1


def test_a_run_goes_on_where_it_stopped_and_survivors_meet_new_tests(root: Path, tmp_path: Path) -> None:
    killed, survived = mutant(root, "LIMIT = 11"), mutant(root, "return x - 1")
    results = _Results(tmp_path / "results.jsonl")
    assert not results.holds(killed, ["a"])
    results.add(killed, ["a"], {"verdict": "killed", "by": "a", "seconds": 1.0})
    results.add(survived, ["a"], {"verdict": "survived", "by": None, "seconds": 1.0})
    again = _Results(tmp_path / "results.jsonl")
    assert again.holds(killed, ["b"])
    assert again.holds(survived, ["a"])
    assert not again.holds(survived, ["a", "b"])
