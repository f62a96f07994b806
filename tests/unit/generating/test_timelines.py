"""Timelines: frames of rows and transitions, and motions of tiny bundles with random weights."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.generation.candidates import DrawPlan, best_clips, draw_clips
from marey.generation.export import finish
from marey.generation.port import Limits, Request
from marey.generation.shots.dispatch import generate_any, resolve_request, timeline_request
from marey.generation.shots.going_on import is_onward
from marey.generation.shots.timeline_plan import even_parts, gaps_of, plan_timeline
from marey.generation.shots.timelines import generate_timelines, row_requests
from marey.items.timeline import read_timeline, timeline_rows
from marey.items.values import MAX_SEED
from marey.registry import get_model, model_names, resolve
from marey.text.features import TextFeatures
from marey.text.graph import build_graph
from tests.support.models import NOT_KEEPING, random_bundle

LIMITS = Limits(16, 196, 20.0, 8, keeps=4)
WALK = "0-3 a person walks forward; 3-5 a person waves; 6-9 a person sits down"


@pytest.fixture(scope="module", params=[name for name in model_names() if get_model(name).keeps_frames])
def generator(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    return load(request.param, tmp_path_factory.mktemp("models"))


def load(model: str, folder: Path) -> Any:
    spec = get_model(model)
    assert spec.training is not None
    config = replace(resolve(spec.training.config)("tiny"), max_frames=196)
    bundle = random_bundle(model, folder / model, config=config, seed=0)
    return resolve(spec.load)(bundle, device="cpu", threads=1)


def text_of(prompt: str, width: int) -> TextFeatures:
    graph = build_graph(prompt, (), max_actions=8, max_specifics=16)
    seed = int.from_bytes(hashlib.sha256(prompt.encode()).digest()[:4], "little")
    nodes = np.random.default_rng(seed).standard_normal((len(graph.nodes), width)).astype(np.float16)
    return TextFeatures(prompt, prompt, graph, nodes)


def asked(text: str, seed: int = 0, width: int = 8) -> Request:
    rows = timeline_rows(read_timeline(text))
    return timeline_request(rows, [text_of(row.prompt, width) for row in rows], seed, None)


def asked_of(generator: Any, text: str, seed: int = 0) -> Request:
    return resolve_request(generator, asked(text, seed, generator.limits.text_width))


class FakeControl:
    """Keeps the reported progress, and drops requests once so much is done."""

    def __init__(self, *dropped: int, after: float = 0.0) -> None:
        self.shares = [0.0]
        self._dropped = set(dropped)
        self._after = after

    def progress(self, done: int, total: int) -> None:
        self.shares.append(done / total)

    def dropped(self) -> set[int]:
        return self._dropped if self.shares[-1] >= self._after else set()


@st.composite
def texts(draw: st.DrawFn) -> str:
    at, rows = 0.0, list[str]()
    while at < 50 and len(rows) < 8:
        end = at + draw(st.integers(20, 200)) / 20
        rows.append(f"{at:g}-{min(end, 60):g} walk")
        at = end + draw(st.sampled_from((0, 0, 0.05, 1, 12)))
    return ";".join(rows)


@given(texts(), st.integers(0, MAX_SEED))
def test_transitions_lie_between_rows_and_leave_most_of_them(text: str, seed: int) -> None:
    request = asked(text, seed)
    assert request.timeline is not None
    plan = plan_timeline(request.timeline, seed, LIMITS)
    assert plan.frames == round(request.timeline[-1].end * 20)
    seeds = [part.seed for part in (*plan.rows, *plan.transitions)]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed <= MAX_SEED for seed in seeds)
    left = {row: row.frames for row in plan.rows}
    for before, transition, after in zip(plan.rows, plan.transitions, plan.rows[1:], strict=False):
        assert before.end == transition.start < transition.end < after.end
        left[after] -= max(0, transition.end - after.start)
    assert all(frames >= 0.6 * row.frames for row, frames in left.items())


@given(st.integers(1, 1200), st.integers(150, 200), st.integers(100, 150))
def test_windows_share_frames_evenly(frames: int, single: int, most: int) -> None:
    parts = even_parts(frames, single, most)
    assert sum(parts) == frames
    assert max(parts) <= max(single, most)
    assert max(parts) - min(parts) <= 1
    assert (len(parts) == 1) == (frames <= single)


def test_gaps_are_named() -> None:
    request = asked(WALK)
    assert request.timeline is not None
    assert [*gaps_of(plan_timeline(request.timeline, 0, LIMITS))] == [(100, 120)]


def test_a_timeline_has_its_length_and_its_rows_are_those_made_alone(generator: Any) -> None:
    request = asked_of(generator, WALK, 7)
    (made,) = generate_timelines(generator, [request])
    assert made is not None
    assert len(made.features) == 180
    assert request.timeline is not None
    plan = plan_timeline(request.timeline, 7, generator.limits)
    (alone,) = generator.generate([Request(request.timeline[0].text, plan.rows[0].seed, 60)])
    untouched = plan.transitions[0].start - 8  # behind it the features pass into the transition
    np.testing.assert_array_equal(made.features[:untouched], alone.features[:untouched])
    assert np.isfinite(made.features).all()
    for part in plan.transitions:
        assert np.abs(made.features[part.start : part.end]).max() > 0


@pytest.mark.parametrize(
    "text", ["0-25 walk; 25-26 wave", "0-1 walk; 40-60 wave", "0-12 walk; 12-13.05 wave; 13.1-22 sit"]
)
def test_long_rows_and_gaps_are_made_of_windows(generator: Any, text: str) -> None:
    request = asked_of(generator, text, 1)
    (made,) = generate_timelines(generator, [request])
    assert made is not None
    assert request.timeline is not None
    assert len(made.features) == round(request.timeline[-1].end * 20)
    assert np.isfinite(made.features).all()
    assert np.abs(made.features).max(axis=1).min() > 0  # no frame is left out


def test_a_timeline_does_not_depend_on_its_batch(generator: Any) -> None:
    ask = [asked_of(generator, text, seed) for seed, text in enumerate([WALK, "0-11 run", "0-2 walk; 3-5 jump"] * 2)]
    plain = [generator.resolve_length(Request(text_of("kick", generator.limits.text_width), 9, 60))]
    (alone,) = generate_timelines(generator, ask[3:4])
    for place, batch in ((1, ask[2:5]), (3, ask), (3, [*plain, *ask[::-1]])):
        there = generate_any(generator, batch)[place]
        assert alone is not None
        assert there is not None
        np.testing.assert_array_equal(there.features, alone.features)


def test_transitions_read_no_prompt_and_long_rows_go_on_with_theirs(
    generator: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    passes: list[Sequence[Request]] = []
    generate = generator.generate

    def watched(requests: Sequence[Request], *given: Any, **named: Any) -> Any:
        passes.append(requests)
        return generate(requests, *given, **named)

    monkeypatch.setattr(generator, "generate", watched)
    generate_timelines(generator, [asked_of(generator, "0-11 run; 11-14 kick")])
    alone, following, between = passes
    assert [(each.text.prompt, each.kept, each.free) for each in alone] == [("run", (), False), ("kick", (), False)]
    assert [(each.text.prompt, len(each.kept), each.free) for each in following] == [("run", 1, False)]
    assert [(len(each.kept), each.free) for each in between] == [(2, True)]
    assert between[0].kept[1].start - between[0].kept[0].end == 8


def test_the_seed_decides(generator: Any) -> None:
    first, again, other = (generate_timelines(generator, [asked_of(generator, WALK, seed)])[0] for seed in (1, 1, 2))
    assert first is not None
    assert again is not None
    assert other is not None
    np.testing.assert_array_equal(first.features, again.features)
    assert not np.array_equal(first.features, other.features)


def test_progress_grows_to_the_end(generator: Any) -> None:
    control = FakeControl()
    generate_any(generator, [asked_of(generator, WALK), asked_of(generator, "0-25 walk; 25-28 wave")], control=control)
    assert control.shares == sorted(control.shares)
    assert control.shares[-1] == 1.0


@pytest.mark.parametrize("after", [0.0, 0.5, 0.9])
def test_a_dropped_timeline_is_left_out_and_others_stay(generator: Any, after: float) -> None:
    ask = [asked_of(generator, WALK, seed) for seed in range(3)]
    made = generate_timelines(generator, ask, control=FakeControl(1, after=after))
    assert [each is None for each in made] == [False, True, False]
    (alone,) = generate_timelines(generator, ask[2:])
    assert alone is not None
    assert made[2] is not None
    np.testing.assert_array_equal(made[2].features, alone.features)


def test_the_manifest_names_rows_transitions_and_gaps(generator: Any) -> None:
    request = asked_of(generator, WALK, 7)
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}), fps=40.0)
    about = clip.manifest
    assert about["prompt"] == about["rewritten"] == WALK
    assert about["prompts"] == [[0, "a person walks forward"], [120, "a person waves"], [240, "a person sits down"]]
    record = about["timeline"]
    assert [(row["start"], row["end"], row["prompt"]) for row in record["rows"]] == [
        *((0, 3, "a person walks forward"), (3, 5, "a person waves"), (6, 9, "a person sits down")),
    ]
    assert record["gaps"] == [{"start": 5.0, "end": 6.0}]
    assert len(record["transitions"]) == 2
    values = [row["match"] for row in record["rows"]]
    assert all(value is not None for value in values)
    assert about["quality"]["match"]["value"] == min(values)
    assert ("off-prompt" in about["quality"]["flags"]) == (min(values) < 0.5)
    assert clip.frames == 359  # as long as 180 frames at 20 a second


def test_candidates_are_of_each_row(generator: Any) -> None:
    request = asked_of(generator, "0-3 a person walks; 3-5 a person waves; 5-16 a person bows", 7)
    assert request.timeline is not None
    settings = generator.settings({})
    (best,) = draw_clips(generator, [request], settings, DrawPlan(best_of=3))
    assert "selection" not in best.manifest
    record = best.manifest["timeline"]["rows"]
    seeds: list[int] = []
    for row, alone in zip(record, row_requests(request, generator.limits), strict=True):
        choice = row["selection"]
        assert (choice["best_of"], len(choice["candidates"])) == (3, 3)
        made = draw_clips(generator, [alone], settings, DrawPlan(best_of=3))
        assert next(made).manifest["selection"] == choice  # as a motion of its own
        seeds.append(choice["candidates"][choice["chosen"]]["seed"])
    assert [row["seed"] for row in record] == seeds
    rows = tuple(replace(row, seed=seed) for row, seed in zip(request.timeline, seeds, strict=True))
    (same,) = draw_clips(generator, [replace(request, timeline=rows)], settings, DrawPlan())
    np.testing.assert_array_equal(best.joints, same.joints)


def test_the_best_rows_of_a_timeline_do_not_depend_on_the_batch(generator: Any) -> None:
    first = asked_of(generator, "0-2 run; 2-4 kick", 1)
    ask = [first, Request(first.text, 3, 60)]
    settings, plan = generator.settings({}), DrawPlan(best_of=2, redraws=1)
    together = list(draw_clips(generator, ask, settings, plan))
    for clip, request in zip(together, ask, strict=True):
        (alone,) = draw_clips(generator, [request], settings, plan)
        np.testing.assert_array_equal(clip.joints, alone.joints)
        assert clip.manifest == alone.manifest
    assert "selection" in together[1].manifest


def test_a_dropped_timeline_has_no_best_rows_and_others_stay(generator: Any) -> None:
    ask = [asked_of(generator, WALK, seed) for seed in (1, 2)]
    settings, plan = generator.settings({}), DrawPlan(best_of=2)
    control = FakeControl(0, after=0.0)
    gone, other = best_clips(generator, ask, settings, plan, control=control)
    assert gone is None
    assert other is not None
    (alone,) = draw_clips(generator, ask[1:], settings, plan)
    np.testing.assert_array_equal(other.joints, alone.joints)
    assert control.shares == sorted(control.shares)
    assert control.shares[-1] == 1.0


def test_a_model_that_keeps_no_frames_refuses(tmp_path: Path) -> None:
    other = load(NOT_KEEPING, tmp_path)
    with pytest.raises(InvalidInput, match=f"the model '{NOT_KEEPING}' cannot generate timelines"):
        asked_of(other, WALK)


def test_features_of_another_encoder_are_refused(generator: Any) -> None:
    with pytest.raises(InvalidInput, match="text features have width 3"):
        resolve_request(generator, asked(WALK, 0, 3))


def test_each_row_needs_features(generator: Any) -> None:
    rows: Sequence[Any] = timeline_rows(read_timeline(WALK))
    with pytest.raises(InvalidInput, match="1 prompts were parsed, and the timeline has 3 rows"):
        timeline_request(rows, [text_of("walk", 8)], 0, None)


@pytest.mark.parametrize(
    ("before", "after", "goes_on"),
    [
        ("a person runs", "a person dies", True),
        ("a person walks forward", "a person dies", True),
        ("a person runs", "a person does a dive roll", True),
        ("a person runs", "a person throws a stone", True),
        ("a person walks forward", "a person throws a stone", False),
        ("a person bows", "a person dies", False),
        ("a person runs", "a person bows", False),
    ],
)
def test_falls_rolls_and_throws_go_out_of_the_way_before_them(before: str, after: str, *, goes_on: bool) -> None:
    one, other = (replace(text_of(words, 4), rewritten=words) for words in (before, after))
    assert is_onward(one, other) is goes_on
