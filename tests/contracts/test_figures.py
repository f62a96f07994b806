"""Motions, rigs, operations and files are what they were when they were recorded (`python -m tests.contracts`)."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest

from tests.contracts.__main__ import RECORDED
from tests.contracts.figures import condensed, differences, figures

RECORDS = json.loads((RECORDED / "motion.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def found() -> dict:
    return json.loads(json.dumps(figures()))


@pytest.mark.parametrize("part", sorted(RECORDS))
def test_figures_are_those_that_are_recorded(part: str, found: dict) -> None:
    assert list(differences(RECORDS[part], found[part], part)) == []


def test_every_part_is_recorded(found: dict) -> None:
    assert found.keys() == RECORDS.keys()


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"a": np.arange(100) * 1.01, "b": [1, "x"]}, "/a: stretch"),
        ({"a": np.arange(99), "b": [1, "x"]}, "/a/s"),
        ({"a": np.arange(100), "b": [2, "x"]}, "/b/0: 1 was recorded, 2 is there"),
        ({"a": np.arange(100), "b": [1, "y"]}, "/b/1: x was recorded, y is there"),
        ({"a": np.arange(100)}, "/b: only recorded"),
    ],
)
def test_a_change_is_told_with_its_place(changed: dict, told: str) -> None:
    recorded = condensed({"a": np.arange(100), "b": [1, "x"]})
    assert list(differences(recorded, copy.deepcopy(recorded))) == []
    assert next(iter(differences(recorded, condensed(changed)))).startswith(told)


def test_rounding_is_none() -> None:
    values = np.random.default_rng(1).normal(size=500)
    assert list(differences(condensed(values), condensed(values.astype(np.float32)))) == []
    values[77] += 0.05
    assert list(differences(condensed(values), condensed(np.random.default_rng(1).normal(size=500)))) != []
