"""Variants are measured on several seeds, once each, and a further time where their intervals touch."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from marey.training.ablation import DECIDES, compare, table, touching

SHARES = {"a": (0.90, 0.92, 0.91), "b": (0.90, 0.93, 0.95), "c": (0.50, 0.51, 0.52)}


def measuring(asked: list[tuple[str, int]]) -> Mapping[str, float]:
    def measured(variant: str, seed: int) -> dict[str, float]:
        asked.append((variant, seed))
        return {DECIDES: SHARES[variant][seed]}

    return measured


def test_variants_whose_intervals_touch_get_a_further_seed(tmp_path: Path) -> None:
    asked: list[tuple[str, int]] = []
    shown = compare(list(SHARES), measuring(asked), tmp_path, "letters", seeds=2)
    assert asked == [(v, s) for s in (0, 1) for v in "abc"] + [("a", 2), ("b", 2)]
    assert [line.split("|")[2].strip() for line in shown.splitlines()[2:]] == ["3", "3", "2"]
    assert (tmp_path / "letters.md").read_text(encoding="utf-8") == shown


def test_a_single_seed_has_no_interval_and_no_further_seed(tmp_path: Path) -> None:
    asked: list[tuple[str, int]] = []
    shown = compare(list(SHARES), measuring(asked), tmp_path, "letters", seeds=1)
    assert asked == [("a", 0), ("b", 0), ("c", 0)]
    assert "±" not in shown


def test_a_second_call_measures_only_what_is_missing(tmp_path: Path) -> None:
    asked: list[tuple[str, int]] = []

    def stopped(variant: str, seed: int) -> Mapping[str, float]:
        if (variant, seed) == ("b", 1):
            raise KeyboardInterrupt
        return measuring(asked)(variant, seed)

    with pytest.raises(KeyboardInterrupt):
        compare(list(SHARES), stopped, tmp_path, "letters", seeds=2)
    done = len(asked)
    compare(list(SHARES), measuring(asked), tmp_path, "letters", seeds=2)
    assert asked[done:] == [("b", 1), ("c", 1), ("a", 2), ("b", 2)]


def test_a_variant_without_the_deciding_number_touches_none() -> None:
    assert touching({"a": [{"loss": 1.0}] * 2, "b": [{DECIDES: 0.5}] * 2, "c": [{DECIDES: 0.5}] * 2}) == ["b", "c"]


def test_the_table_gives_the_mean_and_the_interval_of_each_variant() -> None:
    rows = {"hard": [{"obeyed": 0.9}, {"obeyed": 0.8}, {"obeyed": 0.7}], "random": [{"obeyed": 0.5}, {"obeyed": 0.5}]}
    lines = table(rows).splitlines()
    assert lines[0] == "| variant | seeds | obeyed |"
    mean, half = (float(x) for x in lines[2].split("|")[3].split("±"))
    assert mean == pytest.approx(0.8)
    assert half == pytest.approx(1.96 * 0.1 / 3**0.5, abs=1e-3)
    assert lines[3] == "| random | 2 | 0.500 ± 0.000 |"
