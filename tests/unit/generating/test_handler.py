"""From claimed items to files, with tiny bundles of random weights of each model."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID, uuid4

import numpy as np
import pytest

from marey.bundles import Bundle
from marey.core.errors import InvalidFile, InvalidInput
from marey.core.settings import Settings
from marey.generation.candidates import candidate_seed
from marey.generation.handler import GeneratorHandler
from marey.jobs import Claim, ClaimedItem, ItemStage
from marey.motion.clip import MotionClip, parse_npz
from marey.motion.io.bvh import parse_bvh
from marey.quality.limits import assess, expected_by_prompts
from marey.quality.record import read_quality
from marey.quality.selection import read_selection
from marey.registry import get_model, model_names, resolve
from marey.runtime.export_types import Export
from marey.runtime.handler import Batch, Done, Failed, Outcome
from marey.selector.records import match_of
from marey.text.features import TextFeatures
from marey.text.graph import build_graph
from tests.support.models import random_bundle


class FakeControl:
    """Counts steps and drops what it is told to."""

    def __init__(self, *dropped: UUID) -> None:
        self.steps: list[tuple[int, int]] = []
        self._dropped = frozenset(dropped)

    def progress(self, done: int, total: int) -> None:
        self.steps.append((done, total))

    def dropped(self) -> frozenset[UUID]:
        return self._dropped


def handler_of(model: str) -> GeneratorHandler[Any]:
    return GeneratorHandler(model, resolve(get_model(model).load), 32, Settings(device="cpu", threads=1))


def small_bundle(model: str, path: Path, seed: int = 0) -> Bundle:
    """A bundle of the smallest configuration that makes motions of every length."""
    training = get_model(model).training
    if training is None:  # it runs imported weights alone
        return random_bundle(model, path, seed=seed)
    config = replace(resolve(training.config)("tiny"), max_frames=196)
    return random_bundle(model, path, config=config, seed=seed)


@pytest.fixture(scope="module", params=[name for name in model_names() if get_model(name).random_bundle])
def model(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def bundle(model: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    found = small_bundle(model, tmp_path_factory.mktemp("models") / f"{model}-random")
    return f"{found.path}@{found.weights_sha256[:12]}"


@pytest.fixture(scope="module")
def handler(model: str, bundle: str) -> GeneratorHandler[Any]:
    made = handler_of(model)
    made.load(bundle)
    return made


def text_blob(prompt: str, width: int) -> bytes:
    graph = build_graph(prompt, (), max_actions=8, max_specifics=16)
    seed = int.from_bytes(hashlib.sha256(prompt.encode()).digest()[:4], "little")
    nodes = np.random.default_rng(seed).standard_normal((len(graph.nodes), width)).astype(np.float16)
    return TextFeatures(prompt, prompt, graph, nodes).to_blob()


def make_item(
    prompt: str, seed: int, seconds: float | None, settings: Mapping[str, object] | None = None
) -> ClaimedItem:
    return ClaimedItem(
        id=uuid4(), position=seed, index=seed, variant=0, name=None, prompt=prompt, model="hgm3", bundle="b",
        text_key=prompt, seed=seed, seconds=seconds, settings=settings or {}, tags=(), attempts=0,
    )  # fmt: skip


def make_batch(handler: GeneratorHandler[Any], *items: ClaimedItem) -> Batch:
    width = handler.generator.limits.text_width
    claim = Claim(uuid4(), "default", uuid4(), "hgm3", ItemStage.GENERATE, "k", "b", solo=False, items=items)
    return Batch(claim, items, {item.text_key: text_blob(item.prompt, width) for item in items})


def run(handler: GeneratorHandler[Any], batch: Batch, control: FakeControl | None = None) -> dict[UUID, Outcome]:
    outcomes: dict[UUID, Outcome] = {}
    for bucket in handler.buckets(batch):
        for outcome in handler.run(Batch(batch.claim, tuple(bucket), batch.features), control or FakeControl()):
            assert outcome.item not in outcomes
            outcomes[outcome.item] = outcome
    return outcomes


def export_of(outcome: Outcome) -> Export:
    assert isinstance(outcome, Done)
    return outcome.export()


def clip_of(outcome: Outcome) -> MotionClip:
    return parse_npz(next(file.content for file in export_of(outcome).files if file.format == "npz"))


def test_every_item_is_in_one_bucket_and_one_of_hgm3_has_one_padded_length(handler: GeneratorHandler[Any]) -> None:
    seconds = [2.0, 9.8, 2.1, 6.0, 9.7, 2.0]
    batch = make_batch(handler, *(make_item("a person walks", n, s) for n, s in enumerate(seconds)))
    buckets = handler.buckets(batch)
    assert sorted(item.seed for bucket in buckets for item in bucket) == list(range(6))
    found = sorted(sorted(item.seed for item in bucket) for bucket in buckets)
    by_length, together = [[0, 2, 5], [1, 4], [3]], [[0, 1, 2, 3, 4, 5]]
    assert found == by_length if handler.queue == "hgm3" else found in (by_length, together)


def test_the_files_hold_the_motion_and_where_it_comes_from(handler: GeneratorHandler[Any], bundle: str) -> None:
    item = make_item("a person waves", 7, 2.5, {"guidance": 3.0})
    export = export_of(run(handler, make_batch(handler, item))[item.id])
    files = {file.format: file.content for file in export.files}
    clip = parse_npz(files["npz"])
    assert clip.features.shape == (50, 263)
    assert (export.frames, export.fps) == (clip.frames, clip.fps) == (50, 20.0)
    bvh = parse_bvh(files["bvh"])
    order = [bvh.skeleton.joint_names.index(name) for name in clip.skeleton.joint_names]  # a file is depth first
    np.testing.assert_allclose(bvh.joints()[:, order], clip.joints, atol=1e-3)
    manifest = json.loads(json.dumps(clip.manifest))
    assert manifest["prompt"] == manifest["graph"]["text"] == "a person waves"
    assert manifest["seed"] == 7
    assert manifest["settings"]["guidance"] == 3.0
    assert manifest["random_weights"]
    assert manifest["licence"] == export.licence == "MIT"
    assert bundle.endswith(manifest["weights_sha256"][:12])
    assert manifest == export.manifest
    quality = assess(clip.joints, clip.fps, expected_by_prompts(["a person waves"]))
    matched = match_of(clip, ["a person waves"])
    assert matched.value is not None
    assert read_quality(manifest) == quality.with_match(matched)


def test_the_frame_rate_of_the_files_is_the_items(handler: GeneratorHandler[Any]) -> None:
    item = make_item("a person waves", 7, 2.5, {"fps": 60.0})
    clip = clip_of(run(handler, make_batch(handler, item))[item.id])
    assert clip.fps == 60.0
    assert clip.features_fps == 20.0
    assert clip.frames == 148  # as long as 50 frames at 20 a second: 2.45 s and one frame


def test_an_items_motion_does_not_depend_on_its_batch(handler: GeneratorHandler[Any]) -> None:
    items = [make_item(f"person number {n}", n, 2.0 + n % 3) for n in range(7)]
    batches = [items, items[4:5], items[::-1]]
    clips = [clip_of(run(handler, make_batch(handler, *batch))[items[4].id]) for batch in batches]
    for clip in clips[1:]:  # the tokens are equal; the decoder may round differently beside other items
        np.testing.assert_allclose(clip.features, clips[0].features, atol=1e-4)
        assert clip.manifest == clips[0].manifest


def test_without_seconds_the_seed_decides_the_length_and_other_items_do_not(handler: GeneratorHandler[Any]) -> None:
    items = [make_item("a person runs", n, None) for n in range(4)]
    together = run(handler, make_batch(handler, *items))
    alone = run(handler, make_batch(handler, items[2]))
    assert export_of(together[items[2].id]).frames == export_of(alone[items[2].id]).frames


def test_a_cancelled_item_has_no_outcome_and_steps_are_told(handler: GeneratorHandler[Any]) -> None:
    items = [make_item("a person bows", n, 2.0) for n in range(3)]
    control = FakeControl(items[1].id)
    outcomes = run(handler, make_batch(handler, *items), control)
    assert set(outcomes) == {items[0].id, items[2].id}
    assert control.steps
    assert control.steps[-1][0] == control.steps[-1][1]


def test_when_everything_is_cancelled_nothing_is_made(handler: GeneratorHandler[Any]) -> None:
    items = [make_item("a person bows", n, 2.0) for n in range(2)]
    assert run(handler, make_batch(handler, *items), FakeControl(*(item.id for item in items))) == {}


def test_broken_text_features_fail_their_item_alone(handler: GeneratorHandler[Any]) -> None:
    good, bad, narrow = (make_item(f"a person walks {n}", n, 2.0) for n in range(3))
    batch = make_batch(handler, good, bad, narrow)
    features = {**batch.features, bad.text_key: b"no tensors", narrow.text_key: text_blob(narrow.prompt, 3)}
    outcomes = run(handler, Batch(batch.claim, batch.items, features))
    assert isinstance(outcomes[good.id], Done)
    for item, kind in ((bad, InvalidFile), (narrow, InvalidInput)):
        outcome = outcomes[item.id]
        assert isinstance(outcome, Failed)
        assert isinstance(outcome.problem, kind)
        assert not outcome.retryable


def test_a_length_the_model_cannot_make_fails_its_item_alone(handler: GeneratorHandler[Any]) -> None:
    good, long = make_item("a person walks", 0, 2.0), make_item("a person walks", 1, 59.0)
    outcomes = run(handler, make_batch(handler, good, long))
    assert isinstance(outcomes[good.id], Done)
    outcome = outcomes[long.id]
    assert isinstance(outcome, Failed)
    assert isinstance(outcome.problem, InvalidInput)
    assert "seconds" in str(outcome.problem)


@pytest.mark.parametrize("settings", [{"guidance": 1000.0}, {"no_setting": 1.0}])
def test_a_setting_out_of_range_or_unknown_is_told_by_its_name(
    handler: GeneratorHandler[Any], settings: dict[str, float]
) -> None:
    item = make_item("a person walks", 0, 2.0, settings)
    outcome = run(handler, make_batch(handler, item))[item.id]
    assert isinstance(outcome, Failed)
    assert isinstance(outcome.problem, InvalidInput)
    assert next(iter(settings)) in str(outcome.problem)
    assert not outcome.retryable


BEST = {"best_of": 3, "redraws": 1}


def test_one_candidate_gives_the_same_bytes_as_none(handler: GeneratorHandler[Any]) -> None:
    plain, one = make_item("a person walks", 5, 2.0), make_item("a person walks", 5, 2.0, {"best_of": 1, "redraws": 0})
    files = [export_of(run(handler, make_batch(handler, item))[item.id]).files for item in (plain, one)]
    assert files[0] == files[1]


def test_the_best_of_several_candidates_is_recorded_with_all_of_them(handler: GeneratorHandler[Any]) -> None:
    item = make_item("a person walks", 5, None, BEST)
    clip = clip_of(run(handler, make_batch(handler, item))[item.id])
    assert clip.manifest["seed"] == 5
    found = read_selection(clip.manifest)
    assert found is not None
    assert found.best_of == 3
    assert len(found.candidates) == 3 * (found.redraws + 1)
    assert [each.seed for each in found.candidates] == [candidate_seed(5, n) for n in range(len(found.candidates))]
    quality = read_quality(clip.manifest)
    assert quality is not None
    assert quality.match is not None
    best = max(found.candidates, key=lambda each: (each.ok, each.match or 0, -each.index))
    assert (found.chosen, best.flags, best.match) == (best.index, quality.flags, quality.match.value)
    good = any(each.ok and (each.match or 0) >= 0.5 for each in found.candidates[:3])
    assert found.redraws == (0 if good else 1)


def test_a_candidate_is_what_its_seed_makes_alone_at_the_length_of_the_first(handler: GeneratorHandler[Any]) -> None:
    item = make_item("a person jumps", 11, None, {"best_of": 4})
    clip = clip_of(run(handler, make_batch(handler, item))[item.id])
    first = make_item("a person jumps", 11, None)
    frames = len(clip_of(run(handler, make_batch(handler, first))[first.id]).features)
    found = read_selection(clip.manifest)
    assert found is not None
    alone = make_item("a person jumps", found.candidates[found.chosen].seed, frames / 20.0)
    np.testing.assert_allclose(
        clip.features, clip_of(run(handler, make_batch(handler, alone))[alone.id]).features, atol=1e-4
    )


def test_a_choice_does_not_depend_on_the_batch(handler: GeneratorHandler[Any]) -> None:
    items = [make_item(f"a person waves {n}", n, 2.0 + n % 2, BEST) for n in range(4)]
    together, alone = run(handler, make_batch(handler, *items)), run(handler, make_batch(handler, items[2]))
    clips = [clip_of(outcomes[items[2].id]) for outcomes in (together, alone)]
    np.testing.assert_allclose(clips[0].features, clips[1].features, atol=1e-4)
    assert clips[0].manifest == clips[1].manifest


def test_a_cancelled_item_has_no_candidates_and_steps_of_all_are_counted(handler: GeneratorHandler[Any]) -> None:
    items = [make_item("a person bows", n, 2.0, BEST) for n in range(3)]
    control = FakeControl(items[1].id)
    assert set(run(handler, make_batch(handler, *items), control)) == {items[0].id, items[2].id}
    done = [step for step, _ in control.steps]
    assert done == sorted(done)
    assert all(step <= total for step, total in control.steps)


def test_a_replaced_bundle_is_refused(model: str, bundle: str, tmp_path: Path) -> None:
    other = small_bundle(model, tmp_path / "replaced", seed=1)
    exact = bundle.rpartition("@")[2]
    with pytest.raises(Exception, match="replaced since"):
        handler_of(model).load(f"{other.path}@{exact}")


def test_constrained_items_beside_others_in_a_batch(handler: GeneratorHandler[Any]) -> None:
    path = {"type": "root_path", "frames": [0, 20, 39], "positions_xz": [[0.0, 0.0], [0.2, 0.6], [0.5, 1.0]]}
    free, late = make_item("walk", 1, 2.0), [{**path, "frames": [0, 20, 2000]}]
    bound = replace(make_item("walk", 2, 2.0), constraints=[path])
    bad = replace(make_item("walk", 3, 2.0), constraints=late)
    made = run(handler, make_batch(handler, free, bound, bad))
    failed, clip = made[bad.id], clip_of(made[bound.id])
    assert isinstance(failed, Failed)
    assert failed.problem.where == "constraints.0.frames.2"
    assert clip_of(made[free.id]).manifest["seed"] == 1
    assert clip.manifest["seed"] == 2
    assert clip.manifest["constraints"] == [path]
    first, last = clip.root[0, [0, 2]], clip.root[-1, [0, 2]]
    assert np.linalg.norm(last - first) == pytest.approx(np.hypot(0.5, 1.0), abs=0.25)
    alone = clip_of(run(handler, make_batch(handler, bound))[bound.id])
    assert alone.to_npz() == clip.to_npz()
