"""SnapMoGen's published evaluator: numbers of the published classes, and its import from files of their names."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from marey.bundles import Bundle
from marey.core.errors import Conflict, InvalidBundle, InvalidFile, MareyError, NotFound
from marey.data.prepared import PreparedData
from marey.evaluator.assembly import renew_reference
from marey.evaluator.bundle import write_bundle
from marey.evaluator.config import EvaluatorConfig, NetworkConfig
from marey.evaluator.loading import load_evaluator
from marey.evaluator.published_names import published_name
from marey.evaluator.reference import RealClips
from marey.evaluator.snapmogen import SnapMoGenEvaluator
from marey.evaluator.snapmogen_import import import_snapmogen
from marey.evaluator.snapmogen_model import MODEL, PUBLIC, SnapMoGenMotionEncoder, SnapMoGenSentenceEncoder
from marey.importing import ImportRequest, spec_of
from marey.text.encoders import weights_sha256
from tests.support.prepared import write_prepared
from tests.support.tiny_encoders import write_tiny_t5
from tests.unit.evaluator.published import encoder_shapes, inputs, state_of

GOLDEN = json.loads(Path(__file__).with_name("snapmogen_golden.json").read_text(encoding="utf-8"))
SMALL = replace(PUBLIC, name="small", network=NetworkConfig(layers=1, heads=2, width=16, feedforward=32))
SMALL_SIZES = {"width": 16, "feedforward": 32, "layers": 1}
LENGTHS = {"eval_motion": [320, 128], "eval_text": [120, 37]}
YAML = "exp:\n  name: eval\nmodel:\n  n_heads: 2\n"


def check(found: Tensor, golden: dict) -> None:
    values = found.double().numpy()
    assert list(values.shape) == golden["shape"]
    assert abs(values.mean() - golden["mean"]) < 1e-4
    assert abs(values.std() - golden["std"]) < 1e-4
    for index, value in golden["at"].items():
        assert abs(values[tuple(json.loads(index))] - value) < 1e-4, index


@pytest.mark.parametrize(
    ("key", "kind", "features", "size"),
    [("eval_motion", SnapMoGenMotionEncoder, 148, 320), ("eval_text", SnapMoGenSentenceEncoder, 768, 120)],
)
@torch.inference_mode()
def test_the_networks_give_the_numbers_of_the_published_classes(key: str, kind: type, features: int, size: int) -> None:
    network = kind(PUBLIC).eval()
    state = state_of(encoder_shapes(features))
    own = {name for name in network.state_dict() if name not in ("mean", "std", "text_mean", "text_std")}
    assert {published_name(name) for name in own} == set(state)
    assert len(state) == 77
    network.load_state_dict({name: state[published_name(name)] for name in own}, strict=False)
    x, lengths = inputs(19, 2, size, features), torch.tensor(LENGTHS[key])
    found = network(x, lengths)
    check(found.mean, GOLDEN[key]["mu"])
    check(found.log_variance, GOLDEN[key]["logvar"])
    check(network.raw(x, lengths), GOLDEN[key]["fid"])


# -- importing ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def download(tmp_path: Path) -> Path:
    """The published folder with tiny networks, and the data set's statistics."""
    root = tmp_path / "checkpoint_dir"
    folder = root / "snapmogen" / "evaluator" / "eval_klde-5_late-5_nlayer6_norm"
    (folder / "model").mkdir(parents=True)
    (folder / "evaluator.yaml").write_text(YAML, encoding="utf-8")
    torch.save(state(), folder / "model" / "net_best_top1.tar")
    meta = root / "meta_data"
    meta.mkdir()
    rng = np.random.default_rng(0)
    np.save(meta / "mean.npy", rng.normal(size=296))
    np.save(meta / "std.npy", rng.uniform(0.5, 2, 296))
    return root


def state() -> dict:
    return {
        "latent_enc": state_of(encoder_shapes(148, **SMALL_SIZES)),
        "text_enc": state_of(encoder_shapes(768, **SMALL_SIZES)),
        "ep": 3,
    }


def weights(download: Path) -> Path:
    (file,) = download.glob("**/net_best_top1.tar")
    return file


def run(download: Path, output: Path, t5: Path | None, *, overwrite: bool = False) -> Bundle:
    request = ImportRequest("snapmogen-evaluator", download, output, "LicenseRef-Snap-NC", t5, overwrite)
    return import_snapmogen(request, SMALL)


@pytest.fixture(scope="module")
def t5(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_t5("t5-v1_1-base", tmp_path_factory.mktemp("t5"))


def test_the_imported_evaluator_reads_motions_and_sentences(download: Path, models: Path, t5: Path) -> None:
    run(download, models / "snap-eval", t5)
    bundle = Bundle.open(models / "snap-eval")
    assert not bundle.manifest.commercial
    assert bundle.manifest.text is not None
    assert bundle.manifest.text.encoder_sha256 == weights_sha256(t5)
    evaluator = load_evaluator("snap-eval", device="cpu")
    assert isinstance(evaluator, SnapMoGenEvaluator)
    assert (evaluator.layout, evaluator.fps, evaluator.distance) == ("snapmogen-296", 30, "cosine")
    motion = np.random.default_rng(1).normal(size=(40, 296)).astype(np.float32)
    mean, std = (np.load(download / "meta_data" / f"{name}.npy").astype(np.float32) for name in ("mean", "std"))
    network = SnapMoGenMotionEncoder(SMALL).eval()
    state = torch.load(weights(download), weights_only=True)["latent_enc"]
    own = [name for name in network.state_dict() if name not in ("mean", "std")]
    network.load_state_dict({name: state[published_name(name)] for name in own}, strict=False)
    expected = network.embed(torch.from_numpy((motion - mean) / std)[None], torch.tensor([40]))
    np.testing.assert_allclose(evaluator.embed_motion([motion]), expected.detach().numpy(), atol=1e-5)
    long = " ".join(["a person walks forward"] * 45)
    embedded = evaluator.embed_text(["a person waves", long])
    assert embedded.shape == (2, 16)
    assert np.isfinite(embedded).all()
    assert evaluator._states([long])[0].shape == (120, 768)
    card = (models / "snap-eval" / "README.md").read_text(encoding="utf-8")
    assert "snapmogen/evaluator/eval_klde-5_late-5_nlayer6_norm/model/net_best_top1.tar" in card


def test_the_checkpoint_of_all_networks_is_read_without_its_decoder(download: Path, models: Path, t5: Path) -> None:
    best = run(download, models / "best", t5)
    tables = {key: value for key, value in state().items() if key != "ep"}
    joined = {f"{key}.{name}": value for key, table in tables.items() for name, value in table.items()}
    file = weights(download).with_name("latest.tar")
    torch.save({"eval_model": {**joined, "latent_dec.linear.weight": torch.ones(2, 2)}, "ep": 1}, file)
    weights(download).unlink()
    latest = run(download, models / "latest", None)
    for part in ("motion", "text"):
        for name, value in best.tensors(part).items():
            np.testing.assert_array_equal(value, latest.tensors(part)[name])


def break_weights(download: Path, change: str) -> None:
    file = weights(download)
    broken = state()
    if change == "missing part":
        file.unlink()
    elif change == "truncated":
        file.write_bytes(file.read_bytes()[:1000])
    elif change == "nan":
        broken["latent_enc"]["linear.bias"][0] = float("nan")
        torch.save(broken, file)
    elif change == "shape":
        broken["text_enc"]["linear.bias"] = torch.ones(3)
        torch.save(broken, file)
    elif change == "unknown":
        broken["text_enc"]["extra.weight"] = torch.ones(3)
        torch.save(broken, file)
    elif change == "pickled":
        torch.save(torch.nn.Linear(2, 2), file)
    elif change == "statistics":
        np.save(download / "meta_data" / "std.npy", np.zeros(296))
    elif change == "heads":
        (file.parents[1] / "evaluator.yaml").write_text("n_heads: 3\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "kind", "said"),
    [
        ("missing part", NotFound, r"the evaluator is missing: there is no model/net_best_top1\.tar"),
        ("truncated", InvalidFile, "truncated"),
        ("nan", InvalidFile, r"linear\.bias holds NaN"),
        ("shape", InvalidFile, r"linear\.bias has shape \(3,\), not \(16,\)"),
        ("unknown", InvalidFile, r"does not know: text_enc\.extra\.weight"),
        ("pickled", InvalidFile, "holds code or objects of Python"),
        ("statistics", InvalidFile, "deviations that are not above 0"),
        ("heads", InvalidFile, "number of heads"),
    ],
)
def test_bad_downloads_are_refused_and_leave_nothing(
    download: Path, models: Path, change: str, kind: type[MareyError], said: str
) -> None:
    break_weights(download, change)
    with pytest.raises(kind, match=said) as caught:
        run(download, models / "snap-eval", None)
    assert caught.value.where
    assert not models.exists()


def test_an_evaluator_is_not_imported_without_its_text_encoder_or_twice(download: Path, models: Path, t5: Path) -> None:
    with pytest.raises(NotFound, match="t5-v1_1-base") as caught:
        run(download, models / "snap-eval", None)
    assert "--text-encoder" in str(caught.value.hint)
    assert not models.exists() or not list(models.iterdir())
    run(download, models / "snap-eval", t5)
    with pytest.raises(Conflict):
        run(download, models / "snap-eval", None)
    assert run(download, models / "snap-eval", None, overwrite=True).manifest.model == "snapmogen"


def test_a_reference_of_real_clips_is_added_to_an_imported_evaluator(tmp_path: Path) -> None:
    config = EvaluatorConfig(name="small", network=SMALL.network)  # of the layout that the prepared clips have
    torch.manual_seed(0)
    motion, text = SnapMoGenMotionEncoder(config).eval(), SnapMoGenSentenceEncoder(config)
    states = {"motion": motion.state_dict(), "text": text.state_dict()}
    statistics = np.zeros(263, np.float32), np.ones(263, np.float32)
    spec = spec_of("t5-v1_1-base", "0" * 64)
    imported = write_bundle(
        tmp_path / "a", config, states, statistics, None, text=spec, card="", model=MODEL, dtype=np.float32,
        licence="MIT",
    )  # fmt: skip
    with pytest.raises(InvalidBundle):
        RealClips.of(imported)
    prepared = write_prepared(tmp_path / "prepared")
    made = renew_reference(imported, prepared, tmp_path / "b")
    assert (made.manifest.model, made.manifest.text) == (MODEL, spec)
    for part in states:
        for name, value in made.tensors(part, dtype=None).items():
            np.testing.assert_array_equal(value, states[part][name].numpy())
    data = PreparedData.open(prepared)
    clips = [clip for clip in data.split("test") if clip.captions]
    features = torch.from_numpy(np.array(data.features(clips[0])))[None]
    expected = motion.embed(features, torch.tensor([features.shape[1]])).detach().numpy()
    np.testing.assert_allclose(RealClips.of(made).split("test").motion[:1], expected, atol=2e-3)
