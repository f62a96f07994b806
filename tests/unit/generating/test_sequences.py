"""Prompts of several movements, made as timelines of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from marey.bundles.manifest import BundleManifest
from marey.core.errors import InvalidInput
from marey.generation.candidates import DrawPlan, best_clips
from marey.generation.constraints.draw import constrained_request
from marey.generation.export import finish
from marey.generation.paced import SPEEDS
from marey.generation.port import Request
from marey.generation.posture import NO_POSTURE
from marey.generation.shots import timelines
from marey.generation.shots.dispatch import generate_any, resolve_request, timeline_request
from marey.generation.shots.headings import heading_change, with_whole_turns
from marey.generation.shots.sequences import WAITS_S, as_timeline
from marey.generation.shots.timelines import TimelineMotion
from marey.generation.wish import action_of
from marey.items.timeline import read_timeline, timeline_rows
from marey.motion.edits.timeline_rows import cut_rows
from marey.text.features import TextFeatures
from marey.vocabulary.entries import load_vocabulary
from tests.unit.generating.test_timelines import load, text_of

PROMPT = "a person walks ahead and, once there, waves; then he bows"
PARTS = ("a person walks ahead", "waves", "he bows")


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return load("hgm3", tmp_path_factory.mktemp("models"))


def prompt_of(generator: Any) -> TextFeatures:
    width = generator.limits.text_width
    return replace(text_of(PROMPT, width), movements=tuple(text_of(part, width) for part in PARTS))


def alone(generator: Any, request: Request) -> list[int]:
    """Frames of each row of a request."""
    assert request.timeline is not None
    fps = generator.limits.fps
    return [round(row.end * fps) - round(row.start * fps) for row in request.timeline]


def test_each_movement_is_a_row_as_long_as_it_is_alone(generator: Any) -> None:
    request = resolve_request(generator, Request(prompt_of(generator), 3))
    assert request.timeline is not None
    assert [row.text.prompt for row in request.timeline] == [*PARTS]
    assert request.timeline[0].start == 0
    assert [row.end for row in request.timeline[:-1]] == [row.start for row in request.timeline[1:]]
    other = resolve_request(generator, Request(prompt_of(generator), 4))
    assert min(alone(generator, request)) >= generator.limits.min_frames
    assert alone(generator, resolve_request(generator, Request(prompt_of(generator), 3))) == alone(generator, request)
    (made,) = generate_any(generator, [request])
    (again, *_) = generate_any(generator, [request, other])
    assert made is not None
    assert again is not None
    assert np.array_equal(made.features, again.features)
    assert len(made.features) == sum(alone(generator, request))


def test_a_slow_movement_takes_longer_and_those_after_it_begin_later(generator: Any) -> None:
    text = prompt_of(generator)
    slow = text_of("waves slowly", generator.limits.text_width)
    text = replace(text, movements=(text.movements[0], slow, text.movements[2]))
    request = resolve_request(generator, Request(text, 3))
    assert request.timeline is not None
    asked = alone(generator, request)
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}))
    rows = clip.manifest["timeline"]["rows"]
    frames = [round((row["end"] - row["start"]) * generator.limits.fps) for row in rows]
    assert frames == [asked[0], round(asked[1] / SPEEDS["slow"]), asked[2]]
    assert rows[2]["start"] >= rows[1]["end"]
    assert [row.get("speed") for row in rows] == [None, pytest.approx(SPEEDS["slow"], rel=0.02), None]
    assert clip.frames == round(rows[2]["end"] * generator.limits.fps)


def test_a_slow_movement_with_a_length_of_its_own_keeps_it(generator: Any) -> None:
    text = prompt_of(generator)
    parts = ("walks", "waves slowly for 3 seconds", "bows")
    movements = tuple(text_of(part, generator.limits.text_width) for part in parts)
    whole = replace(text, prompt="walks, waves slowly for 3 seconds, bows", movements=movements)
    request = resolve_request(generator, Request(whole, 3))
    (made,) = generate_any(generator, [request])
    assert request.timeline is not None
    assert made is not None
    asked = alone(generator, request)
    assert asked[1] == round(3 * generator.limits.fps)
    assert len(made.features) == sum(asked)


def test_rows_share_the_length_that_is_asked_for(generator: Any) -> None:
    request = resolve_request(generator, Request(prompt_of(generator), 3, frames=120))
    assert sum(alone(generator, request)) == 120
    free = alone(generator, resolve_request(generator, Request(prompt_of(generator), 3)))
    ratios = np.array(alone(generator, request)) / np.array(free)
    assert np.ptp(ratios) < 0.1


def test_movements_without_a_length_take_none_of_those_that_others_state(generator: Any) -> None:
    width, fps = generator.limits.text_width, generator.limits.fps
    parts = ("walks for 2 seconds", "runs for 3 seconds", "bows")
    text = replace(text_of(", ".join(parts), width), movements=tuple(text_of(part, width) for part in parts))
    rows = alone(generator, resolve_request(generator, Request(text, 3, frames=round(5 * fps))))
    assert rows[:2] == [round(2 * fps), round(3 * fps)]


def test_one_movement_is_as_long_as_the_only_length_that_its_words_name(generator: Any) -> None:
    text = text_of("sprint start then full speed, 3 seconds", generator.limits.text_width)
    request = resolve_request(generator, Request(text, 3))
    assert (request.frames, request.open) == (round(3 * generator.limits.fps), False)


def test_a_length_beyond_the_longest_motion_is_that_of_a_timeline(generator: Any) -> None:
    fps, longest = generator.limits.fps, generator.limits.max_frames / generator.limits.fps
    seconds = round(longest) + 8
    text = text_of(f"a person walks ahead for {seconds} seconds", generator.limits.text_width)
    request = resolve_request(generator, Request(text, 3))
    assert request.timeline is not None
    assert [(row.start, row.end, row.open) for row in request.timeline] == [(0.0, seconds, False)]
    (made,) = generate_any(generator, [request])
    assert made is not None
    assert len(made.features) == seconds * fps
    assert finish(generator, request, made, generator.settings({})).manifest["prompt"] == text.prompt
    beyond = replace(text, prompt="a person walks ahead for 61 seconds")
    assert resolve_request(generator, Request(beyond, 3)).timeline is None


def test_movements_have_the_lengths_of_their_words_beyond_the_longest_motion(generator: Any) -> None:
    width, fps = generator.limits.text_width, generator.limits.fps
    long = round(generator.limits.max_frames / fps) + 2
    parts = (f"walks for {long} seconds", f"runs for {long - 3} seconds")
    text = replace(text_of(", then ".join(parts), width), movements=tuple(text_of(part, width) for part in parts))
    request = resolve_request(generator, Request(text, 3))
    assert alone(generator, request) == [round(long * fps), round((long - 3) * fps)]
    assert request.frames == sum(alone(generator, request))
    shared = replace(text, prompt=f"walks, then runs, {long} seconds in total")
    movements = tuple(text_of(part, width) for part in ("walks", "runs"))
    request = resolve_request(generator, Request(replace(shared, movements=movements), 3))
    assert sum(alone(generator, request)) == round(long * fps)


def test_what_is_too_short_for_its_movements_stays_one_text(generator: Any) -> None:
    request = resolve_request(generator, Request(prompt_of(generator), 3, frames=40))
    assert (request.timeline, request.frames) == (None, 40)


def test_a_length_out_of_range_is_refused_as_ever(generator: Any) -> None:
    with pytest.raises(InvalidInput, match="out of range"):
        resolve_request(generator, Request(prompt_of(generator), 3, frames=4000))


def test_a_model_that_cannot_generate_around_frames_reads_one_text(
    generator: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generator, "limits", replace(generator.limits, keeps=0))
    assert resolve_request(generator, Request(prompt_of(generator), 3)).timeline is None


def test_rows_of_a_timeline_and_motions_on_a_path_are_one_text_each(generator: Any) -> None:
    rows = timeline_rows(read_timeline(f"0-4 {PROMPT.replace(';', ',')}; 4-6 a person bows"))
    request = timeline_request(rows, [prompt_of(generator), prompt_of(generator)], 3, None)
    resolved = resolve_request(generator, request)
    assert resolved.timeline is not None
    assert len(resolved.timeline) == 2
    path = [{"type": "root_path", "frames": [0, 60], "positions_xz": [[0.0, 0.0], [0.0, 3.0]]}]
    assert constrained_request(generator, Request(prompt_of(generator), 3), path, None, None).timeline is None


def test_the_manifest_tells_the_prompt_as_it_was_written_and_the_rows(generator: Any) -> None:
    settings = generator.settings({})
    request = resolve_request(generator, Request(prompt_of(generator), 3))
    (made,) = generate_any(generator, [request], settings)
    assert made is not None
    manifest = finish(generator, request, made, settings).manifest
    assert manifest["prompt"] == PROMPT
    assert [row["prompt"] for row in manifest["timeline"]["rows"]] == [*PARTS]
    assert [text for _, text in manifest["prompts"]] == [*PARTS]
    assert manifest["rewritten"].split("; ")[1].endswith("waves")
    first = round(manifest["timeline"]["rows"][0]["end"] * generator.layout.fps) - 1
    assert cut_rows(manifest, 0, first, generator.layout.fps)["prompt"] == PARTS[0]


def test_candidates_are_drawn_of_each_movement(generator: Any) -> None:
    request = resolve_request(generator, Request(prompt_of(generator), 3))
    (clip,) = best_clips(generator, [request], generator.settings({}), DrawPlan(None, 2, 0))
    assert clip is not None
    assert clip.manifest["prompt"] == PROMPT
    assert all("selection" in row for row in clip.manifest["timeline"]["rows"])


def sequence_of(generator: Any, *movements: tuple[str, str]) -> TextFeatures:
    """Features of a prompt of several movements: the plain words of the action of each, and its own."""
    width = generator.limits.text_width
    parts = [
        replace(text_of(said, width), rewritten=f"{load_vocabulary().need(action).plain_words}, {said}")
        for action, said in movements
    ]
    return replace(text_of(", ".join(said for _, said in movements), width), movements=tuple(parts))


@pytest.fixture
def drawing(generator: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The generator as one whose motions are drawn, too."""
    monkeypatch.setattr(BundleManifest, "draws_bearings", property(lambda manifest: True))
    return generator


def test_movements_begin_where_the_one_before_ended(drawing: Any) -> None:
    said = ("kneel", "he kneels"), ("clap", "claps"), ("get-up", "stands up"), ("walk", "walks off")
    request = resolve_request(drawing, Request(sequence_of(drawing, *said), 3))
    (made,) = generate_any(drawing, [request])
    assert isinstance(made, TimelineMotion)
    heights = drawing.layout.decode(made.features)[:, 0, 1]
    kneels, claps, rises, _ = (slice(round(row.start * 20), round(row.end * 20)) for row in made.timeline)
    assert heights[kneels][0] > 0.85
    assert np.abs(heights[claps] - 0.52).max() < 0.05
    assert np.abs(np.diff(heights[kneels.start : rises.stop])).max() < 0.1
    assert heights[rises].min() > 0.45
    assert heights[rises][-1] > 0.85
    assert all(row.end - row.start < 4.0 for row in made.timeline[:3])
    assert made.timeline[1].changes["posture"] == "knees"


BLOWS = ("punch", "throws a jab"), ("punch", "throws a cross"), ("kick", "kicks")


@pytest.mark.parametrize("said", [BLOWS, (("wave", "waves"), ("bow", "bows"), ("clap", "claps"))])
def test_drawn_movements_go_on_into_each_other(drawing: Any, said: tuple[tuple[str, str], ...]) -> None:
    request = resolve_request(drawing, Request(sequence_of(drawing, *said), 3))
    (made,) = generate_any(drawing, [request])
    assert isinstance(made, TimelineMotion)
    speeds = np.linalg.norm(np.diff(drawing.layout.decode(made.features), axis=0), axis=-1).max(-1) * 20
    for row in made.timeline[1:]:
        begin = round(row.start * 20)
        assert np.median(speeds[begin : begin + 10]) > 0.2  # the body is on its way within half a second
    joints = drawing.layout.decode(made.features)
    if said == BLOWS:
        until = round(made.timeline[2].start * 20) + 6
        assert (joints[:until, [20, 21], 1] - joints[:until, :1, 1]).min() > 0.1


def test_a_way_before_a_drawn_movement_does_not_wait_for_it(drawing: Any) -> None:
    said = ("walk", "walks ahead"), ("wave", "waves"), ("walk", "walks on")
    request = resolve_request(drawing, Request(sequence_of(drawing, *said), 3))
    (made,) = generate_any(drawing, [request])
    assert isinstance(made, TimelineMotion)
    alone = resolve_request(drawing, Request(sequence_of(drawing, said[1]), 3))
    wave = made.timeline[1]
    assert wave.end - wave.start < 2.6
    assert alone.timeline is None


@pytest.mark.parametrize(
    ("jump", "said"),
    [
        ("jump", "jumps over a crate"),
        ("jump", "jumps"),
        ("hop", "hops across a ditch"),
        ("jump-forward", "jumps ahead"),
    ],
)
@pytest.mark.parametrize("run", ["run", "sprint"])
def test_who_jumps_out_of_a_run_leaps(drawing: Any, jump: str, said: str, run: str) -> None:
    rows = (run, "runs"), (jump, said), (run, "runs on")
    request = resolve_request(drawing, Request(sequence_of(drawing, *rows), 3))
    assert request.timeline is not None
    assert [action_of(row.text) for row in request.timeline] == [run, "leap", run]


@pytest.mark.parametrize(
    "rows",
    [
        (("walk", "walks"), ("jump", "jumps over a crate"), ("walk", "walks on")),
        (("run", "runs"), ("jump", "jumps up and down"), ("run", "runs on")),
        (("run", "runs"), ("hop", "hops on one leg"), ("run", "runs on")),
        (("run", "runs"), ("jump", "jumps"), ("wave", "waves")),
    ],
)
def test_other_jumps_are_no_leaps(drawing: Any, rows: tuple[tuple[str, str], ...]) -> None:
    request = resolve_request(drawing, Request(sequence_of(drawing, *rows), 3))
    assert request.timeline is not None
    assert action_of(request.timeline[1].text) == rows[1][0]


def test_models_that_draw_nothing_hand_no_posture_on(generator: Any) -> None:
    said = ("kneel", "he kneels"), ("clap", "claps")
    request = resolve_request(generator, Request(sequence_of(generator, *said), 3))
    assert request.timeline is not None
    assert {row.held for row in request.timeline} == {NO_POSTURE}


def test_who_is_hit_and_dies_falls_at_once(generator: Any) -> None:
    said = ("walk", "he walks"), ("flinch", "is shot in the chest"), ("die", "dies")
    request = resolve_request(generator, Request(sequence_of(generator, *said), 3))
    assert request.timeline is not None
    assert [row.text.said for row in request.timeline] == ["he walks", "is shot in the chest and dies"]
    alone = resolve_request(generator, Request(sequence_of(generator, *said[1:]), 3))
    assert alone.timeline is None
    assert alone.text.rewritten.endswith("dies")
    assert alone.text.prompt == "is shot in the chest, dies"


def test_what_makes_a_body_fall_is_part_of_the_fall(generator: Any) -> None:
    text = sequence_of(generator, ("walk", "he walks"), ("die", "dies"))
    for prompt, said in (
        ("he walks, is shot in the chest and dies", "is shot in the chest and dies"),
        ("he walks and then dies", "dies"),
    ):
        request = resolve_request(generator, Request(replace(text, prompt=prompt), 3))
        assert request.timeline is not None
        assert [row.text.said for row in request.timeline] == ["he walks", said]


def test_who_stands_beside_other_movements_waits_for_no_longer_than_a_moment(generator: Any) -> None:
    said = ("walk", "he walks"), ("idle", "waits"), ("walk", "walks on")
    for seed in range(4):
        request = resolve_request(generator, Request(sequence_of(generator, *said), seed))
        assert request.timeline is not None
        assert request.timeline[1].end - request.timeline[1].start <= WAITS_S + 0.01


@pytest.mark.parametrize("said", ["stops", "he freezes", "halts suddenly", "stops at the top", "comes to a halt"])
def test_who_only_stops_goes_on_after_a_second(drawing: Any, said: str) -> None:
    text = sequence_of(drawing, ("walk", "he walks"), ("idle", said), ("walk", "walks on"))
    request = resolve_request(drawing, Request(text, 3))
    (made,) = generate_any(drawing, [request])
    assert isinstance(made, TimelineMotion)
    assert made.timeline[1].end - made.timeline[1].start <= 1.3


@pytest.mark.parametrize(
    ("rows", "left"),
    [
        ([("die", "falls down dead"), ("idle", "waits"), ("walk", "walks off")], 2),
        ([("die", "falls down dead"), ("get-up", "gets up"), ("walk", "walks off")], 3),
        ([("die", "dies"), ("walk", "walks off as a ghost")], 2),
        ([("die", "falls down"), ("walk", "walks off")], 2),
        ([("walk", "walks up"), ("die", "dies"), ("walk", "walks off")], 2),
    ],
)
def test_the_dead_do_not_walk(generator: Any, rows: list[tuple[str, str]], left: int) -> None:
    request = resolve_request(generator, Request(sequence_of(generator, *rows), 3))
    assert request.timeline is not None
    assert [row.text.said for row in request.timeline] == [said for _, said in rows[:left]]


@pytest.mark.parametrize("said", ["stumbles", "trips over a root", "slips", "he loses his footing", "suddenly trips"])
def test_a_trip_and_the_fall_behind_it_are_one(generator: Any, said: str) -> None:
    width = generator.limits.text_width
    words = ("a person runs", said, "falls on his face")
    movements = [text_of(part, width) for part in words]
    movements[0] = replace(movements[0], rewritten="a person runs")
    movements[2] = replace(movements[2], rewritten="a person dies")
    text = replace(text_of(f"a person runs, {said} and falls on his face", width), movements=tuple(movements))
    rows = as_timeline(generator, Request(text, 1)).timeline
    assert rows is not None
    assert [row.text.prompt for row in rows] == ["a person runs", f"{said} and falls on his face"]


@pytest.mark.parametrize("before", [("walk", "walks"), ("wave", "waves")])
def test_turns_between_movements_lose_nothing_to_transitions(
    drawing: Any, monkeypatch: pytest.MonkeyPatch, before: tuple[str, str]
) -> None:
    asked = list[float]()

    def whole(features: Any, layout: Any, turns: Any) -> Any:
        asked.extend(turn.degrees for turn in turns)
        return with_whole_turns(features, layout, turns)

    monkeypatch.setattr(timelines, "with_whole_turns", whole)
    said = before, ("turn-around", "turns around"), ("bow", "bows")
    (made,) = generate_any(drawing, [resolve_request(drawing, Request(sequence_of(drawing, *said), 3))])
    assert isinstance(made, TimelineMotion)
    (degrees,) = asked
    assert abs(degrees) == pytest.approx(180, abs=4)
    if before[0] == "wave":
        assert heading_change(made.features, drawing.layout) == pytest.approx(degrees, abs=8)


@pytest.mark.parametrize(("way", "degrees"), [("walks to the left", 90.0), ("walks away", 0.0)])
def test_ways_behind_other_movements_go_where_they_are_said_to(
    drawing: Any, monkeypatch: pytest.MonkeyPatch, way: str, degrees: float
) -> None:
    asked = list[float]()

    def whole(features: Any, layout: Any, turns: Any) -> Any:
        asked.extend(turn.degrees for turn in turns)
        return with_whole_turns(features, layout, turns)

    monkeypatch.setattr(timelines, "with_whole_turns", whole)
    said = ("wave", "waves"), ("walk", way)
    generate_any(drawing, [resolve_request(drawing, Request(sequence_of(drawing, *said), 3))])
    assert asked == [degrees]
