"""Runs that run from their first frame."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from marey.generation.asked import changes_of, generate_as_asked
from marey.generation.begun import LEAD_S, begun, frames_to_begin
from marey.generation.port import Limits, Request
from marey.generation.shots.windows import no_text
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body, steady

LAYOUT = HUMANML3D_263
LIMITS = Limits(16, 196, 20.0, 4)


def late_run(stands_s: float) -> np.ndarray[Any, Any]:
    runs = Body(4.0, speed=steady(3.0)).joints()
    stands = runs[:1].repeat(round(20 * stands_s), axis=0)
    return LAYOUT.encode(np.concatenate([stands, runs]))


class Runs:
    """A generator that makes the same run for every request."""

    layout, limits = LAYOUT, LIMITS
    bundle = SimpleNamespace(manifest=SimpleNamespace(draws_bearings=True))

    def generate(self, requests: Any, settings: Any, *, control: Any) -> list[Any]:
        self.frames = [request.frames for request in requests]
        return [SimpleNamespace(features=late_run(1.2)) for _ in requests]


def test_more_frames_are_asked_for_of_runs_alone() -> None:
    assert frames_to_begin("run", 60, LIMITS) == 60 + round(20 * LEAD_S)
    assert frames_to_begin("run", 190, LIMITS) == 196
    assert frames_to_begin("walk", 60, LIMITS) == 60
    assert frames_to_begin("walk", 30, LIMITS) == 48, "shorter walks are made in a crouch"
    assert frames_to_begin("sneak", 30, LIMITS) == 30


def test_what_a_run_stands_before_is_left_out() -> None:
    assert 15 <= begun(late_run(1.2), LAYOUT, "run") <= 25
    assert begun(late_run(0.0), LAYOUT, "run") == 0
    at_once, from_rest = (begun(late_run(1.2), LAYOUT, "sprint", said) for said in ("sprint", "sprint start"))
    assert at_once - from_rest >= 8
    assert begun(late_run(1.2), LAYOUT, "walk") == 0
    assert begun(LAYOUT.encode(Body(3.0).joints()), LAYOUT, "run") == 0


def test_a_run_of_a_fixed_length_has_it_and_runs_at_once() -> None:
    network = Runs()
    prompt = "a man runs"
    request = Request(replace(no_text(4), prompt=prompt, rewritten=prompt), 1, 60)
    (made,) = generate_as_asked(network, [request])  # type: ignore[arg-type]
    assert made is not None
    assert network.frames == [60 + round(20 * LEAD_S)]
    assert len(made.features) == 60
    assert changes_of(made)["begun"] > 0.7
    way = LAYOUT.decode(made.features)[:, 0, [0, 2]]
    assert np.linalg.norm(way[12] - way[6]) > 0.5
