"""The interval, the report and the reviewed list."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.mutants.drawing import Mutant, draw
from tests.mutants.operators import is_valid, mutations
from tests.mutants.report import Equivalent, describe, read_equivalents, wilson

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("killed", "total", "low", "high"), [(81, 263, 0.2553, 0.3662), (10, 10, 0.7225, 1.0), (0, 10, 0.0, 0.2775)]
)
def test_the_interval_is_wilsons(killed: int, total: int, low: float, high: float) -> None:
    assert wilson(killed, total) == pytest.approx((low, high), abs=1e-4)


def test_an_equivalent_mutant_counts_neither_way_and_a_survivor_is_shown_with_its_diff() -> None:
    mutants = _mutants("def f(a):\n    return a + 1 < 7\n")
    assert len(mutants) == 5
    results = {mutant.id: {"verdict": "killed", "tests": 3} for mutant in mutants}
    results[mutants[0].id] = {"verdict": "timeout", "tests": 3}
    for mutant in mutants[-2:]:
        results[mutant.id] = {"verdict": "survived", "tests": 0}
    equivalents = [Equivalent("x.py", *mutants[-2].diff, reason="a is whole")]
    report = describe(7, mutants, results, equivalents)
    assert "| motion | 3 | 1 | 1 | 75.0% | 30.1% to 95.4% |" in report
    before, after = mutants[-1].diff
    assert f"`x.py:2` (motion, {mutants[-1].mutation.kind}): no test runs the line" in report
    assert f"- {before}\n+ {after}\n" in report
    assert mutants[-2].diff[1] not in report


def test_the_diff_holds_the_lines_that_change() -> None:
    mutants = _mutants("def f(a):\n    a = g(\n        a\n    )\n    return a\n")
    assert [mutant.diff for mutant in mutants] == [("a = g( a )", "pass")]


def test_a_seed_always_draws_the_same_mutants(tmp_path: Path) -> None:
    folder = tmp_path / "shared" / "marey" / "motion"
    folder.mkdir(parents=True)
    for name in ("rotations", "kinematics", "skeleton"):
        shutil.copy(ROOT / "shared" / "marey" / "motion" / f"{name}.py", folder)
    first, again, other = (draw(tmp_path, "motion", 20, seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert len({mutant.id for mutant in first}) == 20


def test_each_equivalent_mutant_is_one_of_the_code_and_has_a_reason() -> None:
    for entry in read_equivalents():
        source = (ROOT / entry.path).read_bytes()
        mutants = [Mutant("", one, source, one.apply(source)) for one in mutations(entry.path, source)]
        assert any(entry.matches(mutant) for mutant in mutants), f"no mutation of the code is {entry}"
        assert len(entry.reason) > 10, entry


def _mutants(text: str) -> list[Mutant]:
    source = text.encode()
    found = [one for one in mutations("x.py", source) if is_valid(one, source)]
    return [Mutant("motion", one, source, one.apply(source)) for one in found]
