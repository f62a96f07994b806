"""Motions that are drawn whole, without a network."""

from __future__ import annotations

import random
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.generation.asked import AskedMotion, changes_of, generate_as_asked
from marey.generation.drawn_whole import _asked_for, drawn_whole
from marey.generation.fine_wish import FineWish
from marey.generation.port import Limits, NoControl, Request
from marey.generation.shots.windows import no_text
from marey.generation.wish import Wish
from marey.motion.features import HUMANML3D_263
from marey.posing.limbs import FPS
from marey.quality.record import SHOWN
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263


class Network:
    """A generator that counts what it is asked for."""

    layout = LAYOUT
    limits = Limits(16, 196, 20.0, 4)
    bundle = SimpleNamespace(manifest=SimpleNamespace(draws_bearings=True))

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.dropped: set[int] = set()
        self.reports: list[tuple[int, int]] = []

    def generate(self, requests: Any, settings: Any, *, control: Any) -> list[Any]:
        self.asked = [request.text.prompt for request in requests]
        control.progress(1, 1)
        self.dropped = control.dropped()
        return [SimpleNamespace(features=np.zeros((40, LAYOUT.dim), np.float32)) for _ in requests]


def ask(prompt: str, **more: Any) -> Request:
    return Request(replace(no_text(4), prompt=prompt, rewritten=prompt), 1, **more)


def test_a_network_is_asked_for_what_is_not_drawn_alone() -> None:
    network = Network()

    class Cancelled(NoControl):
        def progress(self, done: int, total: int) -> None:
            network.reports.append((done, total))

        def dropped(self) -> set[int]:
            return {1, 2}

    prompts = ["a man kneels", "a man walks", "a man claps", "a man dances"]
    made = generate_as_asked(network, [ask(each) for each in prompts], control=Cancelled())  # type: ignore[arg-type]
    assert network.asked == ["a man walks", "a man dances"]
    assert network.dropped == {0}
    assert network.reports == [(400, 400)]
    assert [isinstance(each, AskedMotion) and "drawn" in each.changes for each in made] == [True, False, True, False]


def test_no_network_is_asked_where_all_is_drawn() -> None:
    network = Network()
    network.generate = None  # type: ignore[assignment,method-assign]
    (made,) = generate_as_asked(network, [ask("a man kneels")])  # type: ignore[arg-type]
    assert isinstance(made, AskedMotion)
    with pytest.raises(InvalidInput, match="300 frames is out of range"):
        generate_as_asked(network, [ask("a man kneels", frames=300)])  # type: ignore[arg-type]


@pytest.mark.parametrize("action", ["walk", "run", "dance", "sneak", ""])
def test_ways_and_dances_are_left_to_networks(action: str) -> None:
    assert drawn_whole(LAYOUT, action, FineWish(), 1, None) is None


@pytest.mark.parametrize("count", [None, 2, 3])
def test_nods_are_drawn_on_a_body_that_stands(count: int | None) -> None:
    drawn = drawn_whole(LAYOUT, "nod", FineWish(count), 1, None)
    assert drawn is not None
    joints = LAYOUT.decode(drawn.features)
    if count is not None:
        assert len(REPETITIONS["nod"](Motion(joints, LAYOUT.fps))) == count
    assert 1.5 < len(joints) / LAYOUT.fps < 4.5
    assert np.ptp(joints[:, 0, [0, 2]], axis=0).max() < 0.05


def test_the_number_of_frames_is_kept_where_it_is_fixed() -> None:
    for action in ("kneel", "nod", "crawl", "clap"):
        drawn = drawn_whole(LAYOUT, action, FineWish(fixed=True), 1, 120)
        assert drawn is not None
        assert len(drawn.features) == 120


def test_nothing_is_drawn_where_the_network_is_to_make_all() -> None:
    network = Network()
    prompts = ["a man kneels", "a man claps twice", "a man walks and looks around", "a man nods"]
    made = generate_as_asked(network, [ask(each, drawing=False) for each in prompts])  # type: ignore[arg-type]
    assert network.asked == prompts
    assert not any({"drawn", "gaze"} & changes_of(each).keys() for each in made if each)


@pytest.mark.parametrize(
    ("action", "seconds"), [("jump-forward", 2.0), ("wave", 2.0), ("cartwheel", 3.0), ("idle", 1.5)]
)
def test_movements_with_little_time_are_hurried(action: str, seconds: float) -> None:
    for seed in range(3):
        drawn = drawn_whole(LAYOUT, action, FineWish(fixed=True), seed, round(seconds * FPS))
        assert drawn is not None
        assert len(drawn.features) == round(seconds * FPS)
        joints = LAYOUT.decode(drawn.features)
        assert RULES[action](Motion(joints, LAYOUT.fps), "") >= SHOWN
    assert drawn_whole(LAYOUT, "laugh", FineWish(fixed=True), 1, 20) is None


def test_an_open_length_leaves_the_time_that_a_movement_takes() -> None:
    drawn = drawn_whole(LAYOUT, "jump-forward", FineWish(), 1, 30)
    assert drawn is not None
    assert len(drawn.features) > 45


@pytest.mark.parametrize("frames", [24, 40, 160])
@pytest.mark.parametrize("seed", range(4))
def test_a_body_that_stands_for_a_short_while_is_drawn_too(frames: int, seed: int) -> None:
    made = drawn_whole(LAYOUT, "idle", FineWish(prompt="stops", fixed=True), seed, frames)
    assert made is not None
    assert len(made.features) == frames


@pytest.mark.parametrize(
    ("action", "said", "joint"),
    [
        ("raise-arm", "raises an arm", [20, 21]),
        ("kneel", "kneels", [0]),
        ("bow", "bows", [15]),
        ("sit-down", "sits down", [0]),
    ],
)
def test_what_is_drawn_is_done_at_the_pace_that_is_asked_for(action: str, said: str, joint: list[int]) -> None:
    def fastest(prompt: str) -> float:
        speeds = list[float]()
        for seed in range(4):
            (made,) = generate_as_asked(Network(), [replace(ask(prompt), seed=seed)])  # type: ignore[arg-type]
            assert made is not None
            assert changes_of(made)["drawn"] == action
            joints = LAYOUT.decode(made.features)
            speeds.append(float(np.linalg.norm(np.diff(joints[:, joint], axis=0), axis=-1).max()))
        return float(np.mean(speeds))

    slow, usual, quick = (fastest(f"{said}{how}") for how in (" slowly", "", " quickly"))
    assert slow < 0.8 * usual
    assert slow < 0.6 * quick


def test_a_form_that_is_named_is_drawn_from_every_seed() -> None:
    for seed in range(12):
        wish = FineWish(side="left", prompt="roundhouse kick, left leg")
        gestures = list(_asked_for("kick", wish, random.Random(f"{seed} kick"), None))
        assert "kick-round" in gestures[0].kinds
        assert gestures[0].side == "left"


def test_who_stands_before_others_does_so_for_a_moment() -> None:
    request = ask("stands still", beside=("", "walks"), frames=40, open=True)
    (made,) = generate_as_asked(Network(), [request])  # type: ignore[arg-type]
    assert made is not None
    assert len(made.features) == 40


@pytest.mark.parametrize(("prompt", "turns"), [("spins once", 1), ("twirls around twice", 2), ("spins", None)])
def test_a_number_of_spins_is_as_many_whole_turns(prompt: str, turns: int | None) -> None:
    turn = Wish.of(ask(prompt)).turn
    assert turn is not None
    assert (turn.least == 360.0 * turns) if turns else turn.whole


@pytest.mark.parametrize("seed", range(4))
def test_a_bow_between_other_movements_is_no_snap(seed: int) -> None:
    wish = FineWish(prompt="bows", beside=("walks in", "leaves"))
    drawn = drawn_whole(HUMANML3D_263, "bow", wish, seed, None)
    assert drawn is not None
    joints = HUMANML3D_263.decode(drawn.features)
    trunk = joints[:, 12] - joints[:, 0]
    lean = np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1]))
    assert lean.max() > 18
    assert np.abs(np.gradient(lean)).max() * HUMANML3D_263.fps < 150


def test_several_kicks_come_one_out_of_the_other() -> None:
    one, two = (drawn_whole(LAYOUT, "kick", FineWish(count, "left", "low kicks"), 1, None) for count in (1, 2))
    assert one is not None
    assert two is not None
    assert len(one.features) < len(two.features) < 1.75 * len(one.features)


@pytest.mark.parametrize("action", ["die", "clap", "jump", "bow"])
def test_other_words_of_one_action_give_another_take_and_the_same_words_the_same(action: str) -> None:
    said = [f"a person does {action}", f"someone does {action}", f"Someone does  {action}."]
    one, other, again = (drawn_whole(LAYOUT, action, FineWish(prompt=each), 1, None) for each in said)
    assert one is not None
    assert other is not None
    assert again is not None
    np.testing.assert_array_equal(other.features, again.features)
    frames = min(len(one.features), len(other.features))
    ways = [LAYOUT.decode(each.features[:frames]) for each in (one, other)]
    assert np.linalg.norm(ways[0] - ways[1], axis=-1).mean() > 0.01


def test_words_that_would_not_show_the_action_give_what_the_seed_alone_does(monkeypatch: pytest.MonkeyPatch) -> None:
    module, wish = "marey.generation.drawn_whole", FineWish(prompt="a person bows")
    with monkeypatch.context() as patched:
        patched.setattr(f"{module}._shows", lambda *_: False)
        made = drawn_whole(LAYOUT, "bow", wish, 1, None)
    monkeypatch.setattr(f"{module}.worded_seed", lambda seed, _: seed)
    alone = drawn_whole(LAYOUT, "bow", wish, 1, None)
    assert made is not None
    assert alone is not None
    np.testing.assert_array_equal(made.features, alone.features)
