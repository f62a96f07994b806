from __future__ import annotations

import numpy as np
import pytest

from marey.checks.judge import Expectation, judge
from marey.checks.strikes import is_lively, kicks, punches, slashes
from tests.support.bodies import FPS, Body, bower, raiser, runner, steady, walker, waver


def standing(seconds: float = 4.0):
    return Body(seconds).joints()


def kicker():
    joints = standing()
    t = np.arange(len(joints)) / FPS
    up = np.exp(-(((t - 2) / 0.15) ** 2))[:, None]
    joints[:, [5, 8, 11]] += up[..., None] * np.array([[[0, 0.3, 0.3], [0, 0.75, 0.6], [0, 0.8, 0.7]]])
    return joints


def puncher():
    joints = standing()
    t = np.arange(len(joints)) / FPS
    out = np.exp(-(((t - 2) / 0.12) ** 2))
    joints[:, 21] = joints[:, 17] + np.stack([0 * t, 0 * t - 0.05, 0.1 + 0.38 * out], -1)
    return joints


def slasher():
    joints = standing()
    t = np.arange(len(joints)) / FPS
    high = np.clip((t - 1) / 0.6, 0, 1) - np.clip((t - 2) / 0.3, 0, 1)
    for wrist, x in ((20, 0.04), (21, -0.04)):
        joints[:, wrist] = joints[:, 0] + np.stack([0 * t + x, 0.1 + 0.85 * high, 0.3 + 0 * t], -1)
    return joints


@pytest.mark.parametrize(("act", "make"), [("kick", kicker), ("punch", puncher), ("slash", slasher)])
def test_each_strike_is_found_where_it_happens(act, make):
    find = {"kick": kicks, "punch": punches, "slash": slashes}[act]
    found = find(make(), FPS)
    assert found
    assert all(1.0 < a / FPS < 2.5 for a, _ in found)
    assert judge(make(), FPS, [Expectation(act)]).passed


@pytest.mark.parametrize("make", [walker, runner, standing, bower, lambda: waver("both"), lambda: raiser("both")])
def test_other_motions_are_no_strikes_and_no_dance(make):
    for act in ("kick", "slash", "dance"):
        assert not judge(make(), FPS, [Expectation(act)]).passed, act
    assert not judge(make(), FPS, [Expectation("punch")]).passed


def test_running_on_is_lively_but_no_dance():
    assert is_lively(runner(), FPS)
    assert "travels ahead" in judge(runner(), FPS, [Expectation("dance")]).reason


def test_hopping_about_with_arms_and_legs_is_a_dance():
    joints = Body(
        6.0, speed=steady(0.4), left=lambda t: 0.5 + 0.5 * np.sin(5 * t), right=lambda t: 0.5 + 0.5 * np.cos(5 * t)
    ).joints()
    t = np.arange(len(joints)) / FPS
    joints[:, [7, 10], 0] += 0.3 * np.sin(6 * t)[:, None]
    joints[:, [8, 11], 0] += 0.3 * np.cos(6 * t)[:, None]
    assert judge(joints, FPS, [Expectation("dance")]).passed
