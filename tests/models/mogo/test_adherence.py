"""Judging live sessions: what counts as obeyed after a steer, and a whole report of a random bundle."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from marey.checks.prompts import HeldOutPrompt, evaluation_prompts
from marey.cli.roles.adherence import judge_adherence
from marey.models.mogo import adherence
from marey.models.mogo.adherence import pairs_of, steered
from marey.models.mogo.bundle import random_bundle
from tests.support.bodies import bower, walker

FPS = 20.0


def asked(group: str) -> HeldOutPrompt:
    return next(p for p in evaluation_prompts() if p.group == group)


def test_an_act_counts_as_obeyed_where_it_begins_within_two_seconds_of_the_steer() -> None:
    walk = walker(4.5)
    late = np.concatenate([bower(1.5), walk])
    assert steered(walker(6.0), FPS, asked("walk")).passed
    assert steered(late, FPS, asked("walk")).passed
    assert not steered(bower(6.0), FPS, asked("walk")).passed
    refused = steered(walker(6.0), FPS, asked("bow"))
    assert not refused.passed
    assert refused.reason


def test_steers_go_between_different_acts_and_are_the_same_every_time() -> None:
    pairs = pairs_of(evaluation_prompts(), 60)
    assert pairs == pairs_of(evaluation_prompts(), 60)
    for first, second in pairs:
        assert first.expected[0] != second.expected[0]
        assert not first.separate
        assert not second.separate


def test_a_report_holds_whole_motions_and_live_sessions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"LONG": 100, "BEFORE": 1.0, "AFTER": 4.0}.items():
        monkeypatch.setattr(adherence, name, value)
    bundle = random_bundle(tmp_path / "tiny")
    judged = judge_adherence(
        str(bundle.path), seeds=1, seconds=None, settings={}, captions=None, prompts="evaluation", every=50, steers=2,
        walks=1, threads=0, output=tmp_path / "report", progress=lambda done, total: None,
    )  # fmt: skip
    found = json.loads((tmp_path / "report" / "report.json").read_text())
    assert len(found["trials"]) == 4
    assert [len(sessions) for sessions in found["live"].values()] == [2, 1]
    assert "new prompt followed within 2 s of a steer" in judged.markdown
