"""From a small prepared folder to a bundle that embeds: training, assembling, loading."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import save

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle, InvalidFile, InvalidInput, NotFound
from marey.core.hashing import sha256_of
from marey.data.prepared import PreparedData
from marey.evaluator.assembly import assemble
from marey.evaluator.bundle import load_networks
from marey.evaluator.config import TINY, EvaluatorConfig
from marey.evaluator.labels import label_of
from marey.evaluator.loading import load_evaluator
from marey.evaluator.reference import FILE, RealClips
from marey.evaluator.stage_tmr import TMRStage
from marey.evaluator.tmr import TMREvaluator
from marey.evaluator.train import train_stage
from marey.text.encoders import TextEncoder
from marey.training.budget import Budget
from marey.training.motions import MotionData
from marey.training.parts import load_part
from marey.training.staging import TrainOptions
from tests.support.prepared import farthest_move, write_prepared
from tests.support.texts import shared_encoder

ACTS = (
    "walk", "run", "wave", "bow", "kick", "punch", "jump", "sit", "stand", "turn",
    "crawl", "climb", "dance", "spin", "throw", "catch", "push", "pull", "lift", "drop",
    "swim", "fly", "knock", "point", "clap", "nod", "shrug", "stretch", "lean", "crouch",
    "kneel", "roll", "skip", "hop", "march", "sway", "stomp",
)  # fmt: skip
"""37, more than a pool has places and no divisor of the splits' pattern: each split has them all."""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    return PreparedData.open(write_prepared(tmp_path_factory.mktemp("evaluator") / "prepared", 222, ACTS))


@pytest.fixture(scope="module")
def encoder() -> TextEncoder:
    return shared_encoder()


def options(prepared: PreparedData, run: Path, steps: int) -> TrainOptions[EvaluatorConfig]:
    return TrainOptions(prepared.path, run, TINY, Budget(steps=steps), device="cpu", bf16=False, quiet=True)


@pytest.fixture(scope="module")
def run(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    train_stage("tmr", options(prepared, folder, 3))
    return folder


@pytest.fixture(scope="module")
def bundle(prepared: PreparedData, run: Path) -> Bundle:
    assemble(prepared.path, run, run / "judge", TINY)
    return Bundle.open(run / "judge")


@pytest.fixture(scope="module")
def evaluator(bundle: Bundle, encoder: TextEncoder) -> TMREvaluator:
    return TMREvaluator.load(bundle, device="cpu", encoder=encoder)


@pytest.fixture(scope="module")
def motions(prepared: PreparedData) -> list[np.ndarray]:
    return [np.array(prepared.features(clip)) for clip in prepared.clips[:9]]


# -- training ----------------------------------------------------------------------------------------------------------


def test_the_stage_leaves_its_part_with_losses_and_retrieval_of_validation_and_test(run: Path) -> None:
    part = load_part(run / "tmr" / "part")
    assert EvaluatorConfig.from_dict(part.config) == TINY
    terms = {"loss", "reconstruction", "divergence", "latent", "contrast"}
    retrieval = {f"{kind}r{k}" for kind in ("pair_", "label_", "distinct_") for k in (1, 2, 3)} | {
        "median_rank",
        "median_rank_back",
    }
    assert set(part.metrics) == terms | retrieval | {f"test/{name}" for name in retrieval}
    assert all(np.isfinite(value) for value in part.metrics.values())


def test_the_loss_is_the_weighted_sum_of_its_terms(prepared: PreparedData, encoder: TextEncoder) -> None:
    config = replace(TINY, loss=replace(TINY.loss, divergence=0.5, latent=0.25, contrast=2.0))
    torch.manual_seed(0)
    stage = TMRStage(config, MotionData.load(prepared.path, torch.device("cpu")), encoder)
    stage.module.eval()
    found = stage.validate()
    expected = found["reconstruction"] + 0.5 * found["divergence"] + 0.25 * found["latent"] + 2 * found["contrast"]
    assert found["loss"] == pytest.approx(expected, rel=1e-5)


def test_the_evaluator_learns_which_caption_belongs_to_which_motion(prepared: PreparedData, tmp_path: Path) -> None:
    config = replace(TINY, network=replace(TINY.network, width=48, feedforward=96, heads=4))
    config = replace(config, train_tmr=replace(config.train_tmr, batch=32, learning_rate=5e-3))
    found = train_stage("tmr", replace(options(prepared, tmp_path, 60), config=config))
    assert found["test/distinct_r1"] > 0.4  # 0.03 by chance; the clips are new, the actions are not
    assert found["test/median_rank"] < 5  # of 37; 19 by chance


def test_a_warm_start_goes_on_from_the_part_that_is_there(prepared: PreparedData, run: Path, tmp_path: Path) -> None:
    shutil.copytree(run / "tmr" / "part", tmp_path / "tmr" / "part")
    before = load_part(tmp_path / "tmr" / "part").state
    train_stage("tmr", replace(options(prepared, tmp_path, 1), warm=True))
    assert 0 < farthest_move(before, load_part(tmp_path / "tmr" / "part").state) < 0.1


def test_every_clip_is_labelled_and_only_usable_ones_are_drawn(prepared: PreparedData, encoder: TextEncoder) -> None:
    config = replace(TINY, min_frames=60)
    stage = TMRStage(config, MotionData.load(prepared.path, torch.device("cpu")), encoder)
    lengths = [prepared.clips[int(i)].length for i in stage.rows("train")]
    assert min(lengths) >= 60
    assert len(lengths) < len(prepared.split("train"))
    assert len(set(stage.labels.tolist())) == len(ACTS)


def test_data_or_texts_of_another_kind_are_refused(
    prepared: PreparedData, encoder: TextEncoder, tmp_path: Path
) -> None:
    data = MotionData.load(prepared.path, torch.device("cpu"))
    with pytest.raises(InvalidInput, match="this configuration reads kit-251"):
        TMRStage(replace(TINY, layout="kit-251", features=251, fps=12.5), data, encoder)
    with pytest.raises(InvalidFile, match="texts have width 384; this configuration reads 768"):
        TMRStage(replace(TINY, text_width=768), data, encoder)
    with pytest.raises(InvalidInput, match="unknown stage 'tokenizer'"):
        train_stage("tokenizer", options(prepared, tmp_path, 1))
    with pytest.raises(NotFound, match="has not finished"):
        assemble(prepared.path, tmp_path, tmp_path / "bundle", TINY)


# -- the bundle --------------------------------------------------------------------------------------------------------


def test_the_bundle_ships_two_encoders_and_no_decoder(bundle: Bundle) -> None:
    assert set(bundle.manifest.parts) == {"motion", "text", "statistics", "reference"}
    assert (bundle.manifest.kind, bundle.manifest.model, bundle.manifest.layout) == (
        "evaluator",
        "tmr",
        "humanml3d-263",
    )
    assert bundle.tensors("motion", dtype=None)["encoder.project.weight"].dtype == np.float16
    text = bundle.manifest.text
    assert text is not None
    assert (text.encoder, text.labeller, len(text.encoder_sha256 or "")) == ("minilm", "none", 64)
    assert "tmr/test/distinct_r1" in bundle.manifest.metrics
    card = (bundle.path / "README.md").read_text(encoding="utf-8")
    assert f"| distinct_r1 | {bundle.manifest.metrics['tmr/test/distinct_r1']:.3f} |" in card


def test_the_reference_holds_captions_labels_lengths_and_what_the_bundle_makes_of_the_motions(
    bundle: Bundle, prepared: PreparedData, evaluator: TMREvaluator
) -> None:
    reference = RealClips.of(bundle)
    assert set(reference.splits) == {"val", "test"}  # the folder has no compositional clips
    split = reference.split("test")
    clips = prepared.split("test")
    assert [c.id for c in split.clips] == [c.id for c in clips]
    assert [c.label for c in split.clips] == [label_of(c) for c in clips]
    assert [c.frames for c in split.clips] == [c.length for c in clips]
    assert [c.captions for c in split.clips] == [c.captions for c in clips]
    again = evaluator.embed_motion([np.array(prepared.features(c)) for c in clips])
    np.testing.assert_allclose(split.motion, again, atol=4e-3)  # kept in half precision
    assert len(set(split.labels.tolist())) == len(ACTS)
    with pytest.raises(NotFound, match="There are val, test"):
        reference.split("compositional")


def test_a_reference_whose_halves_do_not_fit_is_refused(bundle: Bundle, tmp_path: Path) -> None:
    folder = tmp_path / "other"
    shutil.copytree(bundle.path, folder)
    rows = bundle.read_json(FILE)
    rows["test"] = rows["test"][1:]
    change(folder, FILE, json.dumps(rows).encode())
    with pytest.raises(InvalidBundle, match="do not fit the clips"):
        RealClips.of(Bundle.open(folder))
    rows["test"][0]["joints"] = [0.0]
    change(folder, FILE, json.dumps(rows).encode())
    with pytest.raises(InvalidBundle, match="not a reference"):
        RealClips.of(Bundle.open(folder))


def test_a_bundle_of_another_layout_or_model_is_refused(bundle: Bundle, encoder: TextEncoder) -> None:
    for changes, message in (
        ({"layout": "kit-251", "fps": 12.5}, "read humanml3d-263, not kit-251"),
        ({"kind": "generator"}, "not an evaluator of tmr"),
        ({"text": None}, "declares no text encoder"),
    ):
        changed = Bundle(bundle.path, bundle.manifest.model_copy(update=changes))
        with pytest.raises(InvalidBundle, match=message):
            TMREvaluator.load(changed, device="cpu", encoder=encoder)
    with pytest.raises(InvalidBundle, match="not an evaluator that this version reads"):
        load_evaluator(Bundle(bundle.path, bundle.manifest.model_copy(update={"model": "other"})))


def test_another_text_encoder_is_refused(bundle: Bundle, encoder: TextEncoder) -> None:
    assert bundle.manifest.text is not None
    other = bundle.manifest.text.model_copy(update={"encoder_sha256": "0" * 64})
    changed = Bundle(bundle.path, bundle.manifest.model_copy(update={"text": other}))
    with pytest.raises(InvalidBundle, match="was trained with encoder 'minilm' of sha256 000000000000"):
        TMREvaluator.load(changed, device="cpu", encoder=encoder)
    with pytest.raises(InvalidBundle, match="was trained with encoder"):
        load_evaluator(changed, device="cpu")


def test_a_bundle_without_a_tensor_or_with_other_statistics_is_refused(bundle: Bundle, tmp_path: Path) -> None:
    smaller = bundle.manifest.parameters | {"network": bundle.manifest.parameters["network"] | {"layers": 2}}
    with pytest.raises(InvalidBundle, match="do not fit the configuration"):
        load_networks(Bundle(bundle.path, bundle.manifest.model_copy(update={"parameters": smaller})))
    shutil.copytree(bundle.path, tmp_path / "other")
    change(tmp_path / "other", "statistics.safetensors", save({n: np.ones(67, np.float32) for n in ("mean", "std")}))
    with pytest.raises(InvalidBundle, match=r"statistics have shape \(67,\)"):
        load_networks(Bundle.open(tmp_path / "other"))


# -- embedding ---------------------------------------------------------------------------------------------------------


def test_a_loaded_bundle_embeds_motions_and_sentences_into_one_space(bundle: Bundle, motions: list[np.ndarray]) -> None:
    evaluator = load_evaluator(bundle, device="cpu")
    assert (evaluator.name, evaluator.distance, evaluator.fps) == (bundle.reference, "cosine", 20)
    motion, text = evaluator.embed_motion(motions), evaluator.embed_text(["a person waves", "she bows deeply"])
    assert motion.shape == (len(motions), evaluator.width)
    assert text.shape == (2, evaluator.width)
    assert motion.dtype == text.dtype == np.float32
    assert evaluator.embed_motion([]).shape == evaluator.embed_text([]).shape == (0, evaluator.width)


def test_an_embedding_does_not_depend_on_what_stands_beside_it_or_on_the_order(
    evaluator: TMREvaluator, motions: list[np.ndarray]
) -> None:
    together = evaluator.embed_motion(motions)
    np.testing.assert_array_equal(evaluator.embed_motion(motions[::-1]), together[::-1])
    alone = np.concatenate([evaluator.embed_motion([motion]) for motion in motions])
    np.testing.assert_array_equal(alone, together)
    assert np.abs(together[0] - together[1]).max() > 1e-3
    said = ["a person waves", "she bows deeply and then walks on along a straight line for some time", "run"] * 30
    sentences = evaluator.embed_text(said)
    np.testing.assert_array_equal(sentences[:3], sentences[-3:])
    np.testing.assert_array_equal(np.concatenate([evaluator.embed_text([s]) for s in said[:3]]), sentences[:3])
    assert np.abs(sentences[0] - sentences[2]).max() > 1e-3


def test_the_loaded_evaluator_gives_what_the_trained_network_gave(
    bundle: Bundle, evaluator: TMREvaluator, motions: list[np.ndarray]
) -> None:
    _, motion, _ = load_networks(bundle)
    features = [torch.from_numpy(each)[None] for each in motions]
    expected = torch.cat([motion.embed(each, torch.tensor([each.shape[1]])) for each in features])
    np.testing.assert_allclose(evaluator.embed_motion(motions), expected.numpy(), atol=1e-5)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_broken_motion_is_refused_and_named(evaluator: TMREvaluator, motions: list[np.ndarray], value: float) -> None:
    broken = motions[2].copy()
    broken[5, 100] = value
    broken[7, 3] = value
    with pytest.raises(InvalidInput, match=r"motion 1: 2 of \d+ frames hold NaN or infinite numbers, the first is 5"):
        evaluator.embed_motion([motions[0], broken])


def test_a_motion_of_another_width_or_length_is_refused(evaluator: TMREvaluator, motions: list[np.ndarray]) -> None:
    with pytest.raises(InvalidInput, match=r"motion 0: features have shape .*, not \(T, 263\)"):
        evaluator.embed_motion([motions[0][:, :67]])
    with pytest.raises(InvalidInput, match="has 15 frames; this evaluator reads 16 to 196"):
        evaluator.embed_motion([motions[0][:15]])
    with pytest.raises(InvalidInput, match="has 197 frames"):
        evaluator.embed_motion([np.zeros((197, 263), np.float32)])


def test_a_sentence_that_is_no_prompt_is_refused_and_named(evaluator: TMREvaluator) -> None:
    with pytest.raises(InvalidInput, match="sentence 1: the prompt is empty"):
        evaluator.embed_text(["a person waves", "  "])


def change(folder: Path, name: str, content: bytes) -> None:
    """Replace a bundle's file and its hash."""
    (folder / name).write_bytes(content)
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    size = (folder / name).stat().st_size
    manifest["files"][name] = {"sha256": sha256_of(folder / name), "bytes": size}
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
