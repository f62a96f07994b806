"""Best of N: seeds of candidates, the plan of an item, and which candidate is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.generation import candidates
from marey.generation.candidates import DrawPlan, best_clips, candidate_seed, split_settings
from marey.generation.port import Limits, Request
from marey.generation.shots.windows import no_text
from marey.items.values import MAX_SEED
from marey.motion.features import HUMANML3D_263
from marey.quality.record import Flag, MotionQuality, PromptMatch
from marey.quality.selection import read_selection
from tests.support.generating import Dropping

RECORD = MotionQuality(
    support=["feet"], float_s=0, skate=0, penetration_mm=0, pops=0, range_deg=0, self_contact=0, flags=[], ok=True
)


@given(st.integers(0, MAX_SEED), st.integers(1, 23))
def test_seeds_of_candidates_are_seeds_and_those_of_the_first_are_the_items(seed: int, number: int) -> None:
    assert candidate_seed(seed, 0) == seed
    assert 0 <= candidate_seed(seed, number) <= MAX_SEED
    assert candidate_seed(seed, number) == candidate_seed(seed, number)


def test_seeds_of_candidates_differ() -> None:
    seeds = {candidate_seed(seed, number) for seed in range(100) for number in range(24)}
    assert len(seeds) == 2400


def test_settings_are_split_into_the_networks_and_the_platforms() -> None:
    own, plan = split_settings({"guidance": 3.0, "fps": 30.0, "best_of": 4, "redraws": 2})
    assert own == {"guidance": 3.0}
    assert plan == DrawPlan(30.0, 4, 2)
    assert plan.candidates == 12
    assert split_settings({}) == ({}, DrawPlan())
    assert DrawPlan().is_single
    assert not DrawPlan(redraws=1).is_single


@dataclass(frozen=True)
class FakeClip:
    manifest: dict[str, Any]


class FakeGenerator:
    """Makes motions of which the seed is all that is known."""

    limits = Limits(16, 196, 20.0, 4)
    layout = HUMANML3D_263
    bundle = SimpleNamespace(manifest=SimpleNamespace(draws_bearings=False))

    def __init__(self) -> None:
        self.seeds: list[list[int]] = []

    def generate(self, requests: Sequence[Request], settings: Any, *, control: Any) -> list[Any]:
        self.seeds.append([request.seed for request in requests])
        control.progress(1, 1)
        return [
            None if row in control.dropped() else FakeGenerated(request.seed) for row, request in enumerate(requests)
        ]


@dataclass(frozen=True)
class FakeGenerated:
    seed: int

    @property
    def features(self) -> np.ndarray[Any, Any]:
        return np.zeros((40, 263), np.float32)


def choose(
    monkeypatch: pytest.MonkeyPatch,
    records: Sequence[tuple[bool, float | None]],
    plan: DrawPlan,
    control: Dropping | None = None,
    seeds: Sequence[int] = (5,),
) -> tuple[list[Any], FakeGenerator]:
    """Choose among candidates with these records (ok, match), by their number."""
    known = {candidate_seed(seed, number): record for seed in seeds for number, record in enumerate(records)}

    def finish(generator: Any, request: Request, made: FakeGenerated, settings: Any, **options: Any) -> FakeClip:
        assert options == {"body": None, "fps": plan.fps}
        ok, match = known[made.seed]
        flags = [] if ok else [Flag.SKATING]
        record = RECORD.model_copy(update={"ok": ok, "flags": flags, "match": PromptMatch(value=match)})
        return FakeClip({"seed": request.seed, "quality": record.model_dump(mode="json")})

    monkeypatch.setattr(candidates, "finish", finish)
    generator = FakeGenerator()
    requests = [Request(no_text(4), seed) for seed in seeds]
    return best_clips(generator, requests, None, plan, control=control), generator  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("records", "chosen"),
    [
        ([(True, 0.6), (True, 0.9), (True, 0.7)], 1),
        ([(False, 0.6), (True, 0.2), (False, 0.9)], 2),  # one that shows the prompt first
        ([(False, 1.0), (True, 0.5), (True, 0.7)], 2),  # of these one without flags
        ([(False, 0.4), (True, 0.2), (False, 0.3)], 1),  # where none shows it, one without other flags
        ([(True, 0.8), (True, 0.8), (True, 0.8)], 0),  # then the earlier one
        ([(True, None), (True, None), (False, None)], 0),
        ([(False, 0.1), (False, 0.3), (False, 0.2)], 1),
    ],
)
def test_the_choice(monkeypatch: pytest.MonkeyPatch, records: list[tuple[bool, float | None]], chosen: int) -> None:
    (clip,), _ = choose(monkeypatch, records, DrawPlan(best_of=3))
    found = read_selection(clip.manifest)
    assert found is not None
    assert (found.chosen, found.redraws, len(found.candidates)) == (chosen, 0, 3)
    assert clip.manifest["seed"] == 5
    assert [(each.ok, each.match) for each in found.candidates] == records


def test_rounds_are_drawn_again_only_while_no_candidate_is_good(monkeypatch: pytest.MonkeyPatch) -> None:
    records: list[tuple[bool, float | None]] = [
        (False, 0.9),
        (True, 0.4),
        (True, 0.45),
        (True, 0.8),
        (True, 1.0),
        (True, 1.0),
    ]
    (clip,), generator = choose(monkeypatch, records, DrawPlan(best_of=2, redraws=2))
    found = read_selection(clip.manifest)
    assert found is not None
    assert (found.chosen, found.redraws, len(found.candidates), len(generator.seeds)) == (3, 1, 4, 4)
    (clip,), _ = choose(monkeypatch, [(True, 0.6)], DrawPlan(redraws=2))
    assert len(clip.manifest["selection"]["candidates"]) == 1
    (clip,), _ = choose(monkeypatch, [(True, 0.1), (True, 0.3), (True, 0.2)], DrawPlan(redraws=2))
    assert (clip.manifest["selection"]["chosen"], clip.manifest["selection"]["redraws"]) == (1, 2)


def test_only_items_without_a_good_candidate_are_drawn_again_and_dropped_ones_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    control = Dropping(1)
    clips, generator = choose(monkeypatch, [(True, 0.1), (True, 0.9)], DrawPlan(redraws=1), control, seeds=(5, 6, 7))
    assert [clip is None for clip in clips] == [False, True, False]
    assert generator.seeds == [[5, 6, 7], [candidate_seed(5, 1), candidate_seed(7, 1)]]
    assert control.steps == [(150, 300), (300, 300)]


def test_candidates_have_the_length_of_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int | None] = []

    class Lengths(FakeGenerator):
        def generate(self, requests: Sequence[Request], settings: Any, *, control: Any) -> list[Any]:
            asked.extend(request.frames for request in requests)
            return super().generate(requests, settings, control=control)

    monkeypatch.setattr(candidates, "finish", lambda *_, **__: FakeClip({}))
    best_clips(
        Lengths(), [Request(no_text(4), 1), replace(Request(no_text(4), 2), frames=60)], None, DrawPlan(best_of=2)
    )  # type: ignore[arg-type]
    assert asked == [None, 60, 40, 60]
