"""Streams: the cache against whole sequences, sessions beside each other, saving, steering, endless motion."""

from __future__ import annotations

import functools
from dataclasses import replace

import pytest
import torch

from marey.core.errors import InvalidInput
from marey.models.mogo.config import TINY, InferenceConfig, MOGOConfig
from marey.models.mogo.depth import DepthFrame, DepthStep
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.streaming import StreamBatch
from marey.nn.sampling import guide
from marey.streams.actions import ActionStart
from tests.support.processors import PACKED_TYPES

from .networks import FLAT, TOLD_BY_TOKEN, columns, opened, prompts, transformer

JOINT = replace(TINY, transformer=replace(TINY.transformer, joint=True))
GUIDED = replace(TINY, inference=replace(TINY.inference, guidance=2.0))
WINDOW = TINY.inference.window


def said(seed: int) -> torch.Tensor:
    return prompts(1, seed=seed)[0, 0]


def run(streams: StreamBatch, frames: int) -> dict[int, torch.Tensor]:
    """So many steps: the columns (frames, V) of each session that was there all the time."""
    steps = [streams.step() for _ in range(frames)]
    return {session: torch.stack([step[session] for step in steps]) for session in steps[-1]}


def alone(seed: int, frames: int, model: RQHCTransformer | None = None) -> torch.Tensor:
    """The columns (frames, V) of a session that runs alone."""
    streams = opened(model or transformer(), 1)
    session = streams.start(said(seed), seed)
    return run(streams, frames)[session]


def logits_of(model: RQHCTransformer, states: torch.Tensor, column: torch.Tensor) -> torch.Tensor:
    """Logits (V, K + 1) of the frame that turned out to be `column` (V,)."""
    return model.score(model.refine(states, column[None, :-1]))[0]


@pytest.mark.parametrize("config", [TINY, FLAT, JOINT, TOLD_BY_TOKEN])
def test_cached_logits_equal_those_of_the_whole_sequence_within_the_window(config: MOGOConfig) -> None:
    model, tokens = transformer(config), columns(WINDOW)
    whole = model(prompts(1), tokens)[0]  # (V, n + 1, K + 1)
    streams = opened(model, 2)
    streams.start(said(0), 1)
    for frame in range(WINDOW):
        found = logits_of(model, streams.states(), tokens[0, frame])
        torch.testing.assert_close(found, whole[:, frame], atol=1e-5, rtol=0)
        streams.accept(tokens[:, frame])


@pytest.mark.parametrize("config", [TINY, JOINT, replace(JOINT, inference=GUIDED.inference), TOLD_BY_TOKEN])
def test_a_session_draws_the_same_tokens_beside_others(config: MOGOConfig) -> None:
    frames = 2 * WINDOW + 5
    streams = opened(transformer(config), 3)
    names = {streams.start(said(seed), seed): seed for seed in range(3)}
    for session, found in run(streams, frames).items():
        assert torch.equal(found, alone(names[session], frames, transformer(config)))


@functools.cache
def wide(width: int) -> RQHCTransformer:
    """Wide enough for a plain product to take another kernel for one session than for many."""
    return transformer(
        replace(TINY, transformer=replace(TINY.transformer, width=width, heads=4, feedforward=2 * width))
    )


@pytest.mark.parametrize("dtype", PACKED_TYPES)
@pytest.mark.parametrize(("width", "group"), [(256, 1), (1024, 1), (1024, 8)])
def test_a_session_computes_the_same_bits_beside_others(width: int, group: int, dtype: torch.dtype) -> None:
    model = wide(width)

    def states_of(*seeds: int) -> torch.Tensor:
        streams = opened(model, len(seeds), dtype=dtype, group=group)
        for seed in seeds:
            streams.start(said(seed), seed)
        run(streams, 3)
        return streams.states()

    together = states_of(*range(20))
    for seed in (0, 7, 19):
        assert torch.equal(states_of(seed)[0], together[seed])
    assert torch.equal(states_of(3, 4, 5), together[3:6])


def test_sessions_join_and_leave_between_frames_and_disturb_nobody() -> None:
    streams = opened(transformer(), 3)
    first = streams.start(said(1), 1)
    second = streams.start(said(2), 2)
    before = run(streams, 7)
    streams.stop(first)
    third = streams.start(said(3), 3)
    after = run(streams, 20)
    assert set(after) == {second, third}
    assert torch.equal(before[first], alone(1, 7))
    assert torch.equal(torch.cat([before[second], after[second]]), alone(2, 27))
    assert torch.equal(after[third], alone(3, 20))


def test_one_session_goes_on_alone_and_the_others_then_draw_what_they_would_have_drawn() -> None:
    streams = opened(transformer(), 3)
    names = {streams.start(said(seed), seed): seed for seed in (1, 2, 3)}
    found = {session: [column] for session, column in streams.step().items()}
    middle = list(names)[1]
    for _ in range(9):
        (shown,) = streams.step(middle).items()
        found[shown[0]].append(shown[1])
    for _ in range(6):
        for session, column in streams.step().items():
            found[session].append(column)
    assert {session: len(columns) for session, columns in found.items()} == {
        session: 16 if session == middle else 7 for session in names
    }
    for session, seed in names.items():
        assert torch.equal(torch.stack(found[session]), alone(seed, len(found[session])))


def test_what_went_wrong_in_a_row_is_not_handed_on_to_who_sits_there_next() -> None:
    streams = opened(transformer(), 1)
    spoiled = streams.start(said(1), 1)
    run(streams, 3)
    streams.state.memory.fill_(torch.nan)
    streams.stop(spoiled)
    session = streams.start(said(2), 2)
    assert torch.equal(run(streams, 5)[session], alone(2, 5))


def test_tokens_depend_on_seed_and_prompt() -> None:
    streams = opened(transformer(), 3)
    a, b, c = streams.start(said(1), 1), streams.start(said(1), 2), streams.start(said(2), 1)
    found = run(streams, 10)
    assert not torch.equal(found[a], found[b])
    assert not torch.equal(found[a], found[c])


@pytest.mark.parametrize("frames", [0, 1, 5, WINDOW, 2 * WINDOW + 3])
def test_a_saved_session_goes_on_with_the_very_same_tokens(frames: int) -> None:
    streams = opened(transformer(), 2)
    session = streams.start(said(1), 1)
    for _ in range(frames):
        streams.step()
    saved = streams.save(session)
    expected = run(streams, 20)[session]
    other = opened(transformer(), 4)
    other.start(said(9), 9)
    resumed = other.resume({name: tensor.clone() for name, tensor in saved.items()})
    assert torch.equal(run(other, 20)[resumed], expected)


@pytest.mark.parametrize("config", [TINY, GUIDED, TOLD_BY_TOKEN])
def test_a_steer_changes_position_0_and_nothing_else(config: MOGOConfig) -> None:
    streams = opened(transformer(config), 2)
    session = streams.start(said(1), 1)
    beside = streams.start(said(2), 2)
    run(streams, WINDOW + 3)
    before, other = streams.save(session), streams.save(beside)
    streams.steer(session, said(3))
    after = streams.save(session)
    now, then = after["memory"], before["memory"]  # (layers, 2, H, L, m + W, w / H)
    assert torch.equal(now[..., 1:, :], then[..., 1:, :])
    for kind in range(2):
        for level in range(TINY.tokenizer.levels):
            assert not torch.equal(now[:, kind, :, level, 0], then[:, kind, :, level, 0])
    for name in ("seeds", "made", "skipped", "ends_from", "ended", "last"):
        assert torch.equal(after[name], before[name])
    assert all(torch.equal(part, other[name]) for name, part in streams.save(beside).items())
    fresh = opened(transformer(config), 1)
    expected = fresh.save(fresh.start(said(3), 5))
    torch.testing.assert_close(now[..., 0, :], expected["memory"][..., 0, :])


@pytest.mark.parametrize("config", [TINY, TOLD_BY_TOKEN])
def test_a_steered_stream_equals_the_training_forward_with_a_seam(config: MOGOConfig) -> None:
    model, tokens, seam = transformer(config), columns(WINDOW), 6
    whole = model(torch.cat([prompts(1), prompts(1, seed=1)], 1), tokens, seam=torch.tensor([seam]))[0]
    streams = opened(model, 1)
    session = streams.start(said(0), 1)
    for frame in range(WINDOW):
        if frame == seam:
            streams.steer(session, said(1))
        found = logits_of(model, streams.states(), tokens[0, frame])
        torch.testing.assert_close(found, whole[:, frame], atol=1e-5, rtol=0)
        streams.accept(tokens[:, frame])


@pytest.mark.parametrize("config", [TINY, TOLD_BY_TOKEN])
def test_a_steer_before_the_first_frame_is_a_start_with_that_prompt(config: MOGOConfig) -> None:
    model = transformer(config)
    streams = opened(model, 1)
    session = streams.start(said(1), 7)
    streams.steer(session, said(7))
    assert torch.equal(run(streams, 10)[session], alone(7, 10, model))


@pytest.mark.parametrize("config", [TINY, TOLD_BY_TOKEN])
def test_a_stream_goes_on_behind_frames_that_were_made_before(config: MOGOConfig) -> None:
    model, tokens = transformer(config), columns(WINDOW)
    skipped = 3 * WINDOW + 5
    whole = model(prompts(1), tokens, skipped=torch.tensor([skipped]))[0]
    read = WINDOW - 4
    streams = opened(model, 1)
    streams.start(said(0), 1, past=tokens[0, :read], skipped=skipped, began=ActionStart(0, 0))
    for frame in range(read, WINDOW):
        found = logits_of(model, streams.states(), tokens[0, frame])
        torch.testing.assert_close(found, whole[:, frame], atol=1e-5, rtol=0)
        streams.accept(tokens[:, frame])


def test_of_a_long_past_the_last_window_is_read() -> None:
    model, tokens = transformer(), columns(60)
    streams = opened(model, 2)
    streams.start(said(0), 1, past=tokens[0])
    streams.start(said(0), 1, past=tokens[0, -WINDOW:], skipped=60 - WINDOW)
    first, second = streams.states()
    assert torch.equal(first, second)
    drawn = list(streams.step().values())
    assert torch.equal(*drawn)


def test_frames_that_left_the_window_are_forgotten_and_the_prompt_is_not() -> None:
    model = transformer(replace(FLAT, transformer=replace(FLAT.transformer, layers=1)))
    # With one layer a state reads the window itself: deeper ones remember through what they read.
    tokens = columns(TINY.max_frames)[0]
    other = tokens.clone()
    other[:-WINDOW] = (other[:-WINDOW] + 1) % TINY.tokenizer.codes
    states = []
    for past, prompt in ((tokens, said(0)), (other, said(0)), (tokens, said(1))):
        streams = opened(model, 1)
        streams.start(prompt, 1)
        for column in past:
            streams.states()
            streams.accept(column[None])
        states.append(streams.states())
    torch.testing.assert_close(states[0], states[1])
    assert not torch.allclose(states[0], states[2])


def test_endless_motion_needs_no_more_memory() -> None:
    streams = opened(transformer(), 1)
    streams.start(said(1), 1)
    address = streams.state.memory.data_ptr()
    run(streams, 5 * WINDOW)
    assert streams.state.memory.data_ptr() == address
    assert int(streams.state.made[0]) == 5 * WINDOW


def test_guidance_mixes_the_logits_with_and_without_the_prompt() -> None:
    model = transformer(FLAT)
    config = InferenceConfig(guidance=2.0, upper_guidance=3.0, temperature=0, upper_temperature=0, window=WINDOW)
    streams = opened(model, 1, config)
    session = streams.start(said(2), 1)
    read = (model.prompt(said(2)[None]), model.prompt(said(2)[None], torch.tensor([True])))
    plain = [opening[:, :, None] for opening, _ in read]
    with_prompt, without = (model.score(model.trunk(p.flatten(0, 1), model.reach(0))[:, 0]) for p in plain)
    guided = torch.cat([guide(with_prompt, without, 2.0)[:1], guide(with_prompt, without, 3.0)[1:]])
    guided[0, -1] = -torch.inf
    assert torch.equal(streams.step()[session], guided.argmax(-1))
    assert not torch.equal(guided.argmax(-1), with_prompt.argmax(-1))


def test_upper_levels_without_guidance_go_on_without_the_other_branch() -> None:
    model = transformer()
    config = replace(TINY.inference, guidance=8.0, temperature=0.0, upper_temperature=0.0)
    alone, along, both = (
        opened(model, 1, replace(config, upper_guidance=scale)) for scale in (1.0, 1.0 + 1e-6, config.guidance)
    )  # fmt: skip
    names = [streams.start(said(2), 1) for streams in (alone, along, both)]
    found = [run(streams, 8)[name] for streams, name in zip((alone, along, both), names, strict=True)]
    assert torch.equal(found[0], found[1])
    assert not torch.equal(found[0], found[2])


def test_a_stream_never_ends_and_a_clip_ends_when_END_is_drawn() -> None:
    model = transformer()
    model.head.bias.data[-1] = 100.0  # END is all but certain
    streams = opened(model, 2)
    endless, clip = streams.start(said(1), 1), streams.start(said(1), 1, ends_from=0)
    found = run(streams, 5)
    assert (found[endless] >= 0).all()
    assert (found[endless] < TINY.tokenizer.codes).all()
    assert (found[clip] == -1).all()
    assert torch.equal(found[endless], alone(1, 5, model))


def test_levels_have_temperatures_of_their_own() -> None:
    certain = replace(TINY.inference, upper_temperature=0.0)
    model = transformer(FLAT)
    streams = opened(model, 40, certain)
    for seed in range(40):
        streams.start(said(1), seed)
    first = torch.stack(list(streams.step().values()))
    assert len(first[:, 0].unique()) > 1
    assert all(len(first[:, level].unique()) == 1 for level in range(1, model.levels))


def test_what_cannot_be_is_refused() -> None:
    streams = opened(transformer(), 1)
    session = streams.start(said(1), 1)
    saved = streams.save(session)
    with pytest.raises(InvalidInput, match="all 1 sessions"):
        streams.start(said(1), 1)
    streams.stop(session)
    with pytest.raises(InvalidInput, match="unknown session 1"):
        streams.steer(session, said(1))
    with pytest.raises(InvalidInput, match="frames to continue from are missing"):
        streams.start(said(1), 1, skipped=4)
    with pytest.raises(InvalidInput, match="window of 25 frames"):
        opened(transformer(), 1, replace(TINY.inference, window=25))
    other = opened(transformer(), 1, replace(TINY.inference, window=8))
    with pytest.raises(InvalidInput, match="another model"):
        other.resume(saved)
    assert other.step() == {}
    assert streams.step() == {}


def steered(model: RQHCTransformer, at: int, frames: int) -> torch.Tensor:
    """The columns (frames, V) of a session that is steered from prompt 1 to prompt 2."""
    streams = opened(model, 1)
    session = streams.start(said(1), 9)
    before = run(streams, at)[session]
    streams.steer(session, said(2))
    return torch.cat([before, run(streams, frames - at)[session]])


def test_the_next_act_begins_where_the_model_says_that_one_is_over() -> None:
    model, least = transformer(), TINY.min_frames
    model.head.bias.data[-1] = 100.0  # END is all but certain
    streams = opened(model, 2)
    beside = streams.start(said(3), 4)
    session = streams.start(torch.stack([said(1), said(2)]), 9, ends_from=0)
    found = run(streams, 2 * least + 2)
    assert torch.equal(found[session][: 2 * least], steered(model, least, 2 * least))
    assert (found[session][2 * least :] == -1).all()  # and behind the last one the clip ends
    streams = opened(model, 1)
    lonely = streams.start(said(3), 4)
    assert torch.equal(found[beside], run(streams, 2 * least + 2)[lonely])


def test_an_act_that_does_not_end_by_itself_is_over_after_its_frames() -> None:
    model = transformer()
    model.head.bias.data[-1] = -100.0  # END never comes
    streams = opened(model, 1)
    session = streams.start(torch.stack([said(1), said(2)]), 9, lasts=[10, 10])
    assert torch.equal(run(streams, 20)[session], steered(model, 10, 20))


def test_a_saved_session_still_has_its_acts_to_come_and_a_steer_drops_them() -> None:
    model = transformer()
    model.head.bias.data[-1] = -100.0
    streams = opened(model, 1)
    session = streams.start(torch.stack([said(1), said(2)]), 9, lasts=[10, 10])
    run(streams, 4)
    saved = streams.save(session)
    streams.stop(session)
    again = streams.resume(saved)
    assert torch.equal(run(streams, 16)[again], steered(model, 10, 20)[4:])
    streams.stop(again)
    dropped = streams.resume(saved)
    streams.steer(dropped, said(1))
    other = opened(model, 1)
    plain = other.start(said(1), 9)
    run(other, 4)
    other.steer(plain, said(1))
    assert torch.equal(run(streams, 16)[dropped], run(other, 16)[plain])


@torch.inference_mode()
def test_levels_after_the_second_branch_is_dropped_are_those_of_the_first_alone() -> None:
    model = transformer()
    assert model.depth is not None
    step = DepthStep(model.depth)
    states = torch.randn(3, 2, model.lanes, TINY.transformer.width)
    both, alone = DepthFrame(model.depth, step, states), DepthFrame(model.depth, step, states[:, :1])
    torch.testing.assert_close(both.next(None)[:, :1], alone.next(None))
    both.keep_first_branch()
    below = torch.randn(3, TINY.transformer.width)
    found, expected = both.next(below), alone.next(below)
    assert found.shape == expected.shape == (3, 1, TINY.transformer.width)
    torch.testing.assert_close(found, expected)


def test_a_level_depends_on_the_code_of_the_level_below() -> None:
    model = transformer()
    assert model.depth is not None
    states = torch.randn(1, 1, model.lanes, TINY.transformer.width)
    below = torch.randn(2, TINY.transformer.width)
    found: list[torch.Tensor] = []
    for code in below:
        frame = DepthFrame(model.depth, DepthStep(model.depth), states)
        frame.next(None)
        found.append(frame.next(code[None]))
    assert not torch.allclose(*found)


def test_who_takes_the_row_of_a_clip_that_has_ended_begins_anew() -> None:
    model = transformer()
    model.head.bias.data[-1] = 100.0  # END is all but certain
    streams = opened(model, 1)
    clip = streams.start(said(1), 1, ends_from=0)
    assert (run(streams, 2)[clip] == -1).all()
    streams.stop(clip)
    session = streams.start(said(2), 2)
    assert torch.equal(run(streams, 5)[session], alone(2, 5, model))


def test_a_clip_that_has_ended_goes_on_when_it_is_steered() -> None:
    model = transformer()
    model.head.bias.data[-1] = 100.0
    streams = opened(model, 1)
    clip = streams.start(said(1), 1, ends_from=0)
    assert (run(streams, 2)[clip] == -1).all()
    streams.steer(clip, said(2))
    assert (run(streams, 5)[clip] >= 0).all()
