"""Judging live sessions: what counts as obeyed after a steer, and a whole report of a random bundle."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from marey.checks.judge import CheckVerdict, Expectation
from marey.checks.prompts import HeldOutPrompt, evaluation_prompts
from marey.cli.roles.adherence import judge_adherence
from marey.models.mogo import adherence
from marey.models.mogo.adherence import pairs_of, steered, steered_sessions, walking_sessions
from marey.models.mogo.bundle import random_bundle
from marey.motion.pose import Pose, solve_pose
from marey.motion.skeleton import HUMANML3D
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


class ScriptedPool:
    """Sessions that show the motion of their prompt, from its first frame on; steers are followed, or not."""

    opened: list[ScriptedPool]
    motions: dict[str, Pose]
    follows: bool

    def __init__(self, generator: object, capacity: int) -> None:
        self.skeleton = HUMANML3D
        self.capacity = capacity
        self.seeds: list[int] = []
        self.prompts: list[list[str]] = []
        self.steered_at: list[int] = []
        self.frames = 0
        self._from: list[int] = []
        self.opened.append(self)

    def start(self, text: str, seed: int) -> int:
        self.seeds.append(seed)
        self.prompts.append([text])
        self._from.append(self.frames)
        assert len(self.seeds) <= self.capacity
        return len(self.seeds) - 1

    def steer(self, session: int, text: str) -> None:
        self.steered_at.append(self.frames)
        if self.follows:
            self.prompts[session].append(text)
            self._from[session] = self.frames

    def step(self) -> dict[int, SimpleNamespace]:
        shown = {
            session: SimpleNamespace(frame=self._frame(texts[-1], self.frames - self._from[session]))
            for session, texts in enumerate(self.prompts)
        }
        self.frames += 1
        return shown

    def _frame(self, text: str, at: int) -> SimpleNamespace:
        pose = self.motions[text]
        return SimpleNamespace(rotations=pose.rotations[at], root=pose.root[at])


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> type[ScriptedPool]:
    """Pools in which prompts are their own features; motions are set by the test."""
    monkeypatch.setattr(ScriptedPool, "opened", [], raising=False)
    monkeypatch.setattr(ScriptedPool, "motions", {}, raising=False)
    monkeypatch.setattr(ScriptedPool, "follows", True, raising=False)
    monkeypatch.setattr(adherence, "LiveSessionPool", ScriptedPool)
    return ScriptedPool


GENERATOR: Any = SimpleNamespace(limits=SimpleNamespace(fps=FPS))


def posed(joints: np.ndarray) -> Pose:
    return solve_pose(joints, HUMANML3D, measure=False)


@pytest.mark.parametrize("follows", [True, False])
def test_sessions_are_steered_after_four_seconds_and_judged_by_the_six_that_follow(
    scripted: type[ScriptedPool], follows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(adherence, "SESSIONS", 2)
    monkeypatch.setattr(scripted, "follows", follows)
    walk, bow = asked("walk"), asked("bow")
    still = np.repeat(bower(0.1)[:1], 240, axis=0)
    scripted.motions.update({walk.text: posed(walker(12.0)), bow.text: posed(np.concatenate([bower(3.0), still]))})
    found = steered_sessions(GENERATOR, [walk, bow], {each.text: each.text for each in (walk, bow)}, 5)
    assert [session.seed for session in found] == list(range(5))
    assert [(pool.seeds, pool.frames) for pool in scripted.opened] == [([0, 1], 200), ([2, 3], 200), ([4], 200)]
    assert {at for pool in scripted.opened for at in pool.steered_at} == {80}
    assert [session.passed for session in found] == [follows] * 5
    for session, pair in zip(found, pairs_of([walk, bow], 5), strict=True):
        assert session.prompts == tuple(prompt.text for prompt in pair)
        assert bool(session.reason) != session.passed


def test_walks_are_judged_by_their_last_frames(scripted: type[ScriptedPool], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adherence, "LONG", 180)
    walks = [prompt for prompt in evaluation_prompts() if prompt.group == "walk"][:2]
    standing = np.repeat(walker(0.1)[:1], 80, axis=0)
    walking = walker(5.0)
    stops = np.concatenate([walker(4.0), np.repeat(walker(4.0)[-1:], 100, axis=0)])
    scripted.motions.update({walks[0].text: posed(np.concatenate([standing, walking])), walks[1].text: posed(stops)})
    found = walking_sessions(GENERATOR, [asked("bow"), *walks], {each.text: each.text for each in walks}, 3)
    (pool,) = scripted.opened
    assert (pool.seeds, pool.frames) == ([0, 1, 2], 180)
    assert [session.prompts[0] for session in found] == [walks[0].text, walks[1].text, walks[0].text]
    assert [session.passed for session in found] == [True, False, True]
    assert [session.seed for session in found] == [0, 1, 2]


@pytest.mark.parametrize(("begins", "passed"), [(0, True), (20, True), (40, True), (41, False), (80, False)])
def test_the_new_act_is_looked_for_from_the_steer_to_two_seconds_after_it(
    begins: int, passed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def judged(joints: np.ndarray, fps: float, expected: object) -> CheckVerdict:
        return CheckVerdict(len(joints) == 120 - begins)

    monkeypatch.setattr(adherence, "judge", judged)
    assert steered(np.zeros((120, 22, 3)), FPS, asked("walk")).passed == passed


def test_a_steer_may_go_to_the_other_side_but_never_to_the_same_act() -> None:
    def prompt(text: str, *acts: tuple[str, str], separate: bool = False) -> HeldOutPrompt:
        expected = tuple(Expectation(act, side) for act, side in acts)
        return replace(asked("walk"), text=text, expected=expected, separate=separate)

    left, again = prompt("left", ("wave", "left")), prompt("left again", ("wave", "left"))
    right = prompt("right", ("wave", "right"))
    both = prompt("two acts", ("walk", ""), ("bow", ""))
    apart = prompt("apart", ("walk", ""), separate=True)
    pairs = pairs_of([left, again, right, both, apart], 80)
    assert len(pairs) == 80
    assert {(first.text, second.text) for first, second in pairs} == {
        ("left", "right"), ("left again", "right"), ("right", "left"), ("right", "left again"),
    }  # fmt: skip
