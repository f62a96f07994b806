"""The scores of a report, read without the rest of it."""

from __future__ import annotations

import json
from typing import Any

import pytest

from marey.core.errors import InvalidFile
from marey.evaluator.report import to_json
from marey.measures.scores import read_scores
from tests.support.reports import sample_report

REPORT = sample_report()


def test_the_scores_of_a_report_are_read_as_they_were_written() -> None:
    assert read_scores(to_json(REPORT), "report") == REPORT.scores


def broken(**changes: Any) -> bytes:
    return json.dumps({**json.loads(to_json(REPORT)), **changes}).encode()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"{", "is not JSON"),
        (b"[]", "is not a report"),
        (broken(schema="other"), "is not a report"),
        (broken(version=2), "has version 2; this Marey reads version 1"),
        (broken(scores=None), "`scores`"),
        (broken(scores=[{"index": 0, "variant": 0, "obeyed": 2, "retrieved": None}]), "a score of 2"),
        (broken(scores=[{"index": "0", "variant": 0, "obeyed": 1, "retrieved": None}]), "index is '0'"),
        (broken(scores=[{"index": 0, "variant": 0, "obeyed": 1}]), "retrieved"),
    ],
)
def test_what_has_no_such_scores_is_refused(data: bytes, said: str) -> None:
    with pytest.raises(InvalidFile, match=said):
        read_scores(data, "report")
