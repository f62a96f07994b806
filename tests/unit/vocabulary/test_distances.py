"""How far prompts have a body go."""

from __future__ import annotations

import pytest

from marey.vocabulary.distances import stated_distance


@pytest.mark.parametrize(
    ("prompt", "action", "metres"),
    [
        ("A nurse walks seven metres down the corridor", "walk", 7.0),
        ("sprints 25m", "sprint", 25.0),
        ("the boy jogs eight yards to the fence", "run", 7.32),
        ("she backs up half a metre", "walk-backward", 0.5),
        ("a thief sneaks two and a half meters ahead", "sneak", 2.5),
        ("a 12-metre dash, barefoot", "sprint", 12.0),
        ("steps six feet to the right", "sidestep", 1.83),
        ("crawls a metre and a half on all fours", "crawl", 1.5),
        ("walks for a distance of 4,5 m", "walk", 4.5),
        ("he takes a few paces toward the crowd", "walk", 2.1),
        ("carries the crate 3 metres away from the truck", "carry", 3.0),
    ],
)
def test_distances(prompt: str, action: str, metres: float) -> None:
    assert stated_distance(prompt, action) == pytest.approx(metres, abs=0.01)


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("leaps 3 metres", "leap"),
        ("walks with a 3 m ladder on his shoulder", "walk"),
        ("runs in from 20 metres away", "run"),
        ("walks in a circle 4 metres across", "walk"),
        ("walks on a wall 2 m high", "walk"),
        ("walks at 1.5 m/s", "walk"),
        ("walks with one foot dragging", "walk"),
        ("she walks, both of her feet apart", "walk"),
        ("walks on two feet like a bear", "walk"),
        ("walks 2 metres, then another 3 metres", "walk"),
        ("runs past a 4-metre wall", "run"),
        ("throws the ball 10 metres and walks", "walk"),
        ("walks five minutes", "walk"),
    ],
)
def test_other_lengths_are_no_ways(prompt: str, action: str) -> None:
    assert stated_distance(prompt, action) is None
