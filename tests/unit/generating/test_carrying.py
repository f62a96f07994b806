"""Loads that are lifted, held on the way and put down."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.loaded import with_load
from marey.generation.stated import stated_features
from marey.generation.timed import TimedText
from marey.motion.features import HUMANML3D_263
from marey.text.features import TextFeatures
from marey.text.graph import build_graph
from marey.vocabulary.loads import lifts_load, puts_load
from tests.support.bodies import Body, steady

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, WRISTS = 0, [20, 21]


def drawn(action: str, prompt: str, before: str = "", after: str = "") -> np.ndarray:
    features = stated_features(LAYOUT, action, FineWish(prompt=prompt, beside=(before, after)), None, 3)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def text_of(prompt: str) -> TextFeatures:
    graph = build_graph(prompt, (), max_actions=8, max_specifics=16)
    return TextFeatures(prompt, prompt, graph, np.zeros((len(graph.nodes), 4), np.float16))


def width(joints: np.ndarray) -> np.ndarray:
    """Metres (T,) between the wrists."""
    return np.linalg.norm(joints[:, 20] - joints[:, 21], axis=-1)


@pytest.mark.parametrize(
    ("said", "lifts", "puts"),
    [
        ("hoists a wooden chest", True, False),
        ("grabs the crates", True, False),
        ("picks up a penny", False, False),
        ("takes a bow", False, False),
        ("sets the parcel down by the door", False, True),
        ("lowers it onto the bench", False, True),
        ("puts her hands on her hips", False, False),
        ("sets off", False, False),
        ("drops to one knee", False, False),
    ],
)
def test_which_words_lift_and_put_down_a_load(said: str, lifts: bool, puts: bool) -> None:
    assert lifts_load(said) is lifts
    assert puts_load(said, "walks over there") is puts


def test_it_is_a_load_only_behind_a_way() -> None:
    assert puts_load("puts it down", "turns around")
    assert not puts_load("puts it down", "drinks from it")
    assert not puts_load("puts it down")


def test_a_load_is_held_from_where_it_is_lifted() -> None:
    joints = drawn("pick-up", "lifts a heavy barrel", after="carries it away")
    low = int(joints[:, WRISTS, 1].mean(1).argmin())
    assert joints[low, WRISTS, 1].max() < 0.45
    assert np.abs(width(joints)[low:] - 0.31).max() < 0.04
    assert joints[-1, WRISTS, 1].min() > joints[-1, PELVIS, 1] + 0.1


@pytest.mark.parametrize(
    ("prompt", "before", "height"),
    [
        ("puts it down", "carries it a few steps", (0.25, 0.45)),
        ("sets it on the desk", "walks", (0.8, 1.0)),
        ("puts it down", "walks to the shelf", (1.2, 1.5)),
        ("sets it on the floor", "walks to the table", (0.25, 0.45)),
    ],
)
def test_a_load_is_held_until_it_is_where_it_is_put(prompt: str, before: str, height: tuple[float, float]) -> None:
    joints = drawn("pick-up", prompt, before)
    lets_go = int((width(joints) > 0.37).argmax())
    assert np.abs(width(joints)[: lets_go - 1] - 0.31).max() < 0.05
    assert height[0] < joints[lets_go, WRISTS, 1].mean() < height[1]
    assert joints[0, WRISTS, 1].min() > joints[0, PELVIS, 1] + 0.1
    assert width(joints)[-1] > 0.4


@pytest.mark.parametrize(("last", "holds"), [("sets the crate down", True), ("waves", False)])
def test_the_arms_hold_it_in_all_movements_between(last: str, holds: bool) -> None:
    rows = (
        TimedText(0.0, 2.0, text_of("lifts a crate")),
        TimedText(2.0, 5.0, text_of("walks ahead")),
        TimedText(5.0, 6.0, text_of(last)),
    )
    walk = LAYOUT.encode(Body(6.0, speed=steady(1.2)).joints())
    joints = LAYOUT.decode(with_load(walk, LAYOUT, rows)).astype(np.float64)
    held = np.abs(width(joints) - 0.3) < 0.06
    assert held[45:95].all()
    assert not held[:30].any()
    assert bool(held[103:106].all()) is holds


def test_small_things_leave_the_arms_to_the_network() -> None:
    rows = (TimedText(0.0, 2.0, text_of("picks up a coin")), TimedText(2.0, 6.0, text_of("walks ahead")))
    walk = LAYOUT.encode(Body(6.0, speed=steady(1.2)).joints())
    assert with_load(walk, LAYOUT, rows) is walk
