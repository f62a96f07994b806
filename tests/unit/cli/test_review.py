"""Texts beside motions on the pages of `marey review`."""

from __future__ import annotations

from dataclasses import replace

from marey.cli.commands.review import _caption, _facts
from marey.client import Candidate, Motion, MotionQuality, Selection
from marey.viz.render import facts_of
from tests.support.walker import walker

BOW = Motion(id="m", job="a", index=3, name="greet", prompt="a person bows", seed=7, frames=60, fps=20.0)


def facts(*motions: Motion, sheet: bool = False) -> list[str]:
    return _facts(motions, {motion.job: f"day {motion.job}" for motion in motions}, sheet=sheet)


def test_a_choice_is_counted_among_the_recorded_candidates() -> None:
    fitted = tuple(Candidate(index=index) for index in (0, 3, 5, 6))
    last, first = (replace(BOW, selection=Selection(best_of=8, chosen=index, candidates=fitted)) for index in (6, 0))
    assert facts(last) == ["00003  ·  greet  ·  seed 7  ·  3.0 s  ·  candidate 4 of 4"]
    assert facts(first) == ["00003  ·  greet  ·  seed 7  ·  3.0 s  ·  candidate 1 of 4"]


def test_motions_of_several_jobs_name_their_job() -> None:
    assert facts(BOW, replace(BOW, job="b")) == [
        "00003  ·  greet  ·  day a  ·  seed 7  ·  3.0 s",
        "00003  ·  greet  ·  day b  ·  seed 7  ·  3.0 s",
    ]


def test_a_contact_sheet_tells_seed_length_and_bundle_once() -> None:
    others = replace(BOW, job="b", bundle="hgm3-open@4b73363936fc"), replace(BOW, bundle="other-open@4b73363936fc")
    assert facts(*others, sheet=True) == ["00003  ·  greet  ·  day b", "00003  ·  greet  ·  day a"]
    assert facts(*others)[0] == "00003  ·  greet  ·  day b  ·  hgm3-open  ·  seed 7  ·  3.0 s"
    clip = walker(seconds=3.0)
    drawn = facts_of(replace(clip, manifest={**clip.manifest, "seed": 7, "bundle": "hgm3-open@4b73363936fc"}))
    assert all(fact in drawn for fact in ("3.0 s", "seed 7", "hgm3-open@4b73363936fc"))


def test_a_contact_sheet_names_the_flags_of_a_motion() -> None:
    flagged = replace(BOW, quality=MotionQuality(flags=("floating", "off-prompt")))
    assert _caption("00003", flagged) == "00003  ·  floating, off-prompt  ·  a person bows"
    assert _caption("00003", BOW) == "00003  ·  a person bows"
