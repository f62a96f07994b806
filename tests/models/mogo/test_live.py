"""Live sessions: from prompts to finished frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.config import TINY
from marey.models.mogo.generate import Generator, SamplingSettings
from marey.models.mogo.live import LiveSessionPool
from marey.motion.live import LiveMotion
from marey.runtime.live.port import LiveFrame
from marey.streams.actions import ActionStart
from marey.streams.frames import decode_frame, encode_frame
from tests.support.prepared import text_features


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Generator:
    return Generator.load(random_bundle(tmp_path_factory.mktemp("mogo") / "random-tiny"), device="cpu", threads=1)


def run(pool: LiveSessionPool, session: int, frames: int) -> list[LiveFrame]:
    return [pool.step()[session] for _ in range(frames)]


def roots(frames: list[LiveFrame]) -> np.ndarray:
    return np.stack([made.frame.root for made in frames])


def test_frames_are_those_of_the_whole_clip_decoded_at_once(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 1)
    made = run(pool, pool.start(text_features(0), 3), 30)
    tokens = np.stack([frame.tokens for frame in made])
    features = generator.tokenizer.decode(generator.columns(tokens)[None])[0].numpy()
    motion = LiveMotion(generator.layout)
    state = motion.start()
    for number, frame in enumerate(made):
        shown, state = motion.step(features[number : number + 1], state)
        assert frame.frame.number == number
        np.testing.assert_allclose(frame.frame.root, shown.root[0], atol=1e-5)
        turned = np.abs((frame.frame.rotations * shown.rotations[0]).sum(-1))
        np.testing.assert_allclose(turned, 1, atol=1e-4)


def test_sessions_come_and_go_and_disturb_nobody(generator: Generator) -> None:
    alone = LiveSessionPool(generator, 1)
    wanted = run(alone, alone.start(text_features(1), 5), 20)
    pool = LiveSessionPool(generator, 3)
    first = pool.start(text_features(0), 1)
    found = [pool.step() for _ in range(3)]
    mine = pool.start(text_features(1), 5)
    found += [pool.step() for _ in range(5)]
    last = pool.start(text_features(2), 9)
    found += [pool.step() for _ in range(5)]
    pool.stop(first)
    found += [pool.step() for _ in range(10)]
    ours = [step[mine] for step in found if mine in step]
    assert len(pool) == 2
    assert [len(step) for step in found] == [1] * 3 + [2] * 5 + [3] * 5 + [2] * 10
    assert [step[last].frame.number for step in found[8:]] == list(range(15))
    for made, expected in zip(ours, wanted, strict=False):
        assert np.array_equal(made.tokens, expected.tokens)
        np.testing.assert_allclose(made.frame.root, expected.frame.root, atol=1e-5)


def test_a_session_goes_on_in_another_room_where_it_was(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 1, SamplingSettings(temperature=0.0, upper_temperature=0.0))
    session = pool.start(text_features(0), 7)
    before = run(pool, session, 60)
    after = run(pool, session, 5)
    other = LiveSessionPool(generator, 2, SamplingSettings(temperature=0.0, upper_temperature=0.0))
    other.start(text_features(3), 1)
    tokens = np.stack([made.tokens for made in before])
    resumed = run(other, other.start(text_features(0), 7, past=tokens, prompt=2), 5)
    assert [made.frame.number for made in resumed] == [60, 61, 62, 63, 64]
    assert {made.frame.prompt for made in resumed} == {2}
    steps = np.linalg.norm(np.diff(roots(before), axis=0), axis=1)
    seam = np.linalg.norm(resumed[0].frame.root - before[-1].frame.root)
    assert seam <= 2 * steps.max()  # where it goes is its own affair; that it starts where it was is not
    np.testing.assert_allclose(resumed[0].frame.root[[0, 2]], after[0].frame.root[[0, 2]], atol=0.05)


def test_a_steer_counts_the_prompt_and_changes_what_follows(generator: Generator) -> None:
    guided = SamplingSettings(guidance=10.0)  # random weights hear a prompt so softly that few draws would differ
    rooms = [LiveSessionPool(generator, 1, guided) for _ in range(2)]
    sessions = [pool.start(text_features(0), 4) for pool in rooms]
    same = [run(pool, session, 6) for pool, session in zip(rooms, sessions, strict=True)]
    rooms[1].steer(sessions[1], text_features(1))
    later = [run(pool, session, 12) for pool, session in zip(rooms, sessions, strict=True)]
    assert all(np.array_equal(a.tokens, b.tokens) for a, b in zip(*same, strict=True))
    assert any(not np.array_equal(a.tokens, b.tokens) for a, b in zip(*later, strict=True))
    assert [made.frame.prompt for made in (*same[1], *later[1])] == [0] * 6 + [1] * 12


def test_a_paused_session_goes_on_with_the_frames_it_would_have_shown(generator: Generator) -> None:
    alone = LiveSessionPool(generator, 1)
    wanted = run(alone, alone.start(text_features(1), 5), 12)
    pool = LiveSessionPool(generator, 2)
    mine, other = pool.start(text_features(1), 5), pool.start(text_features(0), 2)
    found = [pool.step()[mine] for _ in range(4)]
    pool.pause(mine)
    assert [set(pool.step()) for _ in range(3)] == [{other}] * 3
    with pytest.raises(InvalidInput, match="taken"):
        pool.start(text_features(2), 0)
    for refused in (lambda: pool.pause(mine), lambda: pool.steer(mine, text_features(0)), lambda: pool.resume(other)):
        with pytest.raises(InvalidInput):
            refused()
    pool.resume(mine)
    found += [pool.step()[mine] for _ in range(8)]
    for made, expected in zip(found, wanted, strict=True):
        assert made.frame.number == expected.frame.number
        assert np.array_equal(made.tokens, expected.tokens)
        np.testing.assert_allclose(made.frame.root, expected.frame.root, atol=1e-5)
    pool.pause(mine)
    pool.stop(mine)
    assert len(pool) == 1


def test_a_session_catches_up_alone_and_all_go_on_as_if_it_had_not_been_behind(generator: Generator) -> None:
    pool, alike = LiveSessionPool(generator, 3), LiveSessionPool(generator, 3)
    others, mine = [pool.start(text_features(0), 2), pool.start(text_features(2), 3)], pool.start(text_features(1), 5)
    found = {name: [frame] for name, frame in pool.step().items()}
    found[mine] += pool.catch_up(mine, 6)
    for _ in range(3):
        for name, frame in pool.step().items():
            found[name].append(frame)
    assert [made.frame.number for made in found[mine]] == list(range(10))
    for name, (text, seed) in zip([*others, mine], [(0, 2), (2, 3), (1, 5)], strict=True):
        wanted = run(alike, alike.start(text_features(text), seed), len(found[name]))
        assert [made.frame.number for made in found[name]] == list(range(len(wanted)))
        for made, expected in zip(found[name], wanted, strict=True):
            assert np.array_equal(made.tokens, expected.tokens)
            np.testing.assert_allclose(made.frame.rotations, expected.frame.rotations, atol=1e-5)


def test_frames_can_be_sent(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 1)
    (made,) = run(pool, pool.start(text_features(0), 0), 1)
    sent = decode_frame(encode_frame(made.frame), joints=len(pool.skeleton.joint_names))
    assert (sent.number, sent.prompt, sent.contacts) == (0, 0, made.frame.contacts)
    np.testing.assert_allclose(sent.root, made.frame.root)


def test_what_cannot_be_is_refused_and_leaves_the_room_as_it_was(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 1)
    for start in (
        lambda: pool.start(text_features(0, width=512), 0),
        lambda: pool.start(text_features(0), -1),
        lambda: pool.start(text_features(0), 0, past=np.zeros((3, TINY.tokenizer.levels + 1), np.int16)),
        lambda: pool.start(text_features(0), 0, past=np.full((3, TINY.tokenizer.levels), 999, np.int16)),
        lambda: pool.stop(5),
        lambda: pool.steer(5, text_features(0)),
    ):
        with pytest.raises(InvalidInput):
            start()
        assert len(pool) == 0
    assert pool.step() == {}
    session = pool.start(text_features(0), 0)
    with pytest.raises(InvalidInput, match="taken"):
        pool.start(text_features(0), 1)
    assert set(pool.step()) == {session}
    with pytest.raises(InvalidInput):
        LiveSessionPool(generator, 1, replace(SamplingSettings(), top_k=2.0))


ACTS = replace(
    text_features(0),
    actions=("walk forward", "wave"),
    action_rows=np.concatenate([text_features(0).nodes[:1], text_features(1).nodes[:1]]),
)


def in_second_act(generator: Generator, pool: LiveSessionPool) -> tuple[int, list[LiveFrame], int]:
    """A session five frames into its second action: its name, its frames, and the one at which that action began."""
    session = pool.start(ACTS, 7)
    made = run(pool, session, 1)
    while made[-1].action == 0:
        made += run(pool, session, 1)
    began = made[-1].frame.number
    return session, made + run(pool, session, 4), began


def test_a_session_goes_on_with_the_act_that_plays(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 1)
    session, made, began = in_second_act(generator, pool)
    assert 0 < began <= generator.actions(ACTS)[1][0]
    tokens = np.stack([frame.tokens for frame in made])
    other = LiveSessionPool(generator, 2)
    resumed = other.start(ACTS, 7, past=tokens, prompt=0, began=ActionStart(began, 1))
    assert {frame.action for frame in run(other, resumed, 60)} == {1}
    pool.pause(session)
    pool.resume(session)
    assert {frame.action for frame in run(pool, session, 60)} == {1}


def test_an_act_that_plays_ends_when_it_would_have_ended(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 2, SamplingSettings(temperature=0.0, upper_temperature=0.0))
    _, made, began = in_second_act(generator, pool)
    tokens = np.stack([frame.tokens for frame in made[: began - 3]])
    resumed = pool.start(ACTS, 7, past=tokens, prompt=0, began=ActionStart(0, 0))
    actions = [pool.step()[resumed].action for _ in range(generator.actions(ACTS)[1][0])]
    assert 0 in actions[:1]
    assert actions.index(1) + began - 3 <= generator.actions(ACTS)[1][0]  # not a whole first action from here on


def test_a_place_that_the_prompt_does_not_have_is_refused(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 1)
    for began in (ActionStart(0, 2), ActionStart(1, 0), ActionStart(-1, 0), ActionStart(0, -1)):
        with pytest.raises(InvalidInput, match="is not among"):
            pool.start(ACTS, 0, began=began)
        assert len(pool) == 0
