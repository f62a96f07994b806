"""Bearings of prompts and of their generated motions: which are drawn, where, and what the manifest says."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from marey.bundles import Bundle
from marey.generation.bearing import BorneSpan, borne_spans, fitting, with_bearing
from marey.generation.export import finish
from marey.generation.port import Request
from marey.generation.shots.dispatch import generate_any, resolve_request
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import StatedBearing
from tests.support.bearings import FPS, HEAD, WRISTS, named
from tests.unit.generating.test_timelines import load, text_of


def test_who_carries_has_the_load_that_is_named_or_one_before_the_belly() -> None:
    for prompt, name in (
        ("a person walks with a load", "load"),
        ("he carries a sack over his shoulder", "sack-carried"),
    ):
        request = Request(text=text_of(prompt, 8), seed=3)
        (span,) = borne_spans(request, FPS, 80)
        assert [each.name for each in span.stated] == [name]


def test_the_manifest_says_what_is_drawn() -> None:
    spans = [BorneSpan(0, 40, (named("limp", "left"), named("old")), "walk", 3)]
    record = [{"name": "limp", "side": "left"}, {"name": "old"}]
    assert with_bearing({"seed": 1}, spans, FPS) == {"seed": 1, "bearing": record}
    assert with_bearing({"seed": 1}, [], FPS) == {"seed": 1}
    rows = [{"start": 0.0, "end": 2.0}, {"start": 2.0, "end": 5.0}]
    second = [replace(spans[0], begin=40, end=100)]
    timeline = with_bearing({"timeline": {"rows": rows}}, second, FPS)["timeline"]
    assert timeline["rows"] == [rows[0], {**rows[1], "bearing": record}]


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A generator whose bundle reads prompts behind their plain action."""
    made = load("hgm3", tmp_path_factory.mktemp("models"))
    manifest = made.bundle.manifest
    text = manifest.text.model_copy(update={"plain_action": True, "movements": True})
    made.bundle = Bundle(made.bundle.path, manifest.model_copy(update={"text": text}))
    return made


def asked(generator: Any, prompt: str, rewritten: str) -> Request:
    return Request(replace(text_of(prompt, generator.limits.text_width), rewritten=rewritten), 3, frames=80)


def test_a_finished_motion_has_the_bearing_of_its_prompt_and_says_so(generator: Any) -> None:
    request = asked(generator, "a tired soldier salutes", "a person stands upright")
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}))
    assert clip.manifest["bearing"] == [{"name": "tired"}, {"name": "salute"}]
    plain = finish(generator, asked(generator, "a person stands", "a person stands"), made, generator.settings({}))
    assert "bearing" not in plain.manifest
    assert np.abs(clip.joints - plain.joints).max() > 0.2
    quality, without = (each.manifest["quality"]["match"] for each in (clip, plain))
    assert quality == without  # the motion as it was made


def test_a_bearing_that_does_not_fit_the_action_is_not_drawn(generator: Any) -> None:
    request = asked(generator, "a limping soldier punches", "a person punches, a limping soldier punches")
    assert borne_spans(request, FPS, 80) == []
    assert borne_spans(replace(request, free=True), FPS, 80) == []


def test_a_blow_to_a_part_of_the_body_is_drawn_whole_and_not_as_a_bearing(generator: Any) -> None:
    flinches = "a person stands upright, breathing calmly, until hit"
    (span,) = borne_spans(asked(generator, "gets hit", flinches), FPS, 80)
    assert [each.name for each in span.stated] == ["flinch"]
    assert borne_spans(asked(generator, "gets hit in the stomach and stumbles back", flinches), FPS, 80) == []


def test_a_movement_that_has_a_name_is_drawn_without_a_pose_and_has_no_match(generator: Any) -> None:
    request = asked(generator, "a tired man does burpees", "a person stands upright")
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}))
    assert clip.manifest["bearing"] == [{"name": "burpee"}]
    assert clip.manifest["quality"]["match"]["value"] is None
    assert clip.joints[:, HEAD, 1].min() < 0.8 < 2.0 < clip.joints[:, WRISTS, 1].max()


def test_a_bundle_that_reads_prompts_as_they_are_has_none(generator: Any) -> None:
    request = asked(generator, "a soldier salutes", "a person stands upright")
    (made,) = generate_any(generator, [request])
    manifest = generator.bundle.manifest
    text = manifest.text.model_copy(update={"plain_action": False, "movements": False})
    other = copy(generator)
    other.bundle = Bundle(generator.bundle.path, manifest.model_copy(update={"text": text}))
    assert made is not None
    assert "bearing" not in finish(other, request, made, generator.settings({})).manifest


def test_what_is_said_of_the_person_holds_for_every_row(generator: Any) -> None:
    width = generator.limits.text_width
    rows = (
        replace(text_of("an old man walks in with his arms crossed", width), rewritten="a person walks forward"),
        replace(text_of("salutes", width), rewritten="a person stands upright"),
        replace(text_of("and bows", width), rewritten="a person bows"),
    )
    whole = replace(text_of("an old man walks in with his arms crossed, salutes and bows", width), movements=rows)
    request = resolve_request(generator, Request(whole, 3))
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}))
    drawn = [[each["name"] for each in row.get("bearing", ())] for row in clip.manifest["timeline"]["rows"]]
    assert drawn == [["old", "arms-crossed"], ["old", "salute"], []]


def test_work_ends_with_its_movement(generator: Any) -> None:
    width = generator.limits.text_width
    rows = (
        replace(text_of("an old man hammers a nail", width), rewritten="a person stands upright"),
        replace(text_of("and walks away", width), rewritten="a person walks forward"),
    )
    whole = replace(text_of("an old man hammers a nail and walks away", width), movements=rows)
    request = resolve_request(generator, Request(whole, 3))
    spans = borne_spans(request, FPS, round(20 * FPS))
    assert [[each.name for each in span.stated] for span in spans] == [["old", "hammering"], ["old"]]


def test_a_limp_is_on_the_leg_that_another_movement_hurts(generator: Any) -> None:
    width = generator.limits.text_width
    rows = (
        replace(text_of("gets hit", width), rewritten="a person stands upright, breathing calmly, until hit"),
        replace(text_of("limps on", width), rewritten="a person walks forward"),
    )
    for side in ("left", "right"):
        whole = replace(text_of(f"takes a bullet to the {side} leg and limps on", width), movements=rows)
        request = resolve_request(generator, Request(whole, 3))
        limp = borne_spans(request, FPS, round(20 * FPS))[-1].stated[0]
        assert (limp.name, limp.side) == ("limp", side)


def test_gestures_are_in_the_order_of_the_prompt() -> None:
    for prompt in ("yawns and scratches his head", "scratches his head and yawns"):
        names = [each.name for each in fitting(stated_bearings(prompt), "idle")]
        assert names == (["yawn", "head-scratch"] if prompt.startswith("yawns") else ["head-scratch", "yawn"])


def test_a_phone_stays_at_the_ear_of_who_nods() -> None:
    assert StatedBearing("phone-call").shown_in("nod") == "body"
