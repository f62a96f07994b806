"""An imported TMR computes as the public code does, run beside it on the same random weights.

MAREY_TMR_CODE names a checkout of Mathux/TMR (MIT); it needs the package `einops`.
"""

from __future__ import annotations

import json
import os
import shutil
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.evaluator.metrics.retrieval import all_ranks
from marey.evaluator.tmr_published import PublishedTMREvaluator
from marey.importing import run_import
from marey.text.loading import load_encoder
from tests.support.tiny_encoders import write_tiny_distilbert
from tests.support.tmr_download import PUBLISHED, write_tmr_download

CHECKOUT = os.environ.get("MAREY_TMR_CODE")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHECKOUT is None, reason="MAREY_TMR_CODE names no checkout of Mathux/TMR"),
]
SENTENCES = ["a person walks", "A person waves his left hand, and then turns slowly", "forward"]


def public(file: str) -> ModuleType:
    """A module of the checkout, loaded by its file: its packages have the names of ours."""
    pytest.importorskip("einops")
    spec = spec_from_file_location("public_" + Path(file).stem, Path(str(CHECKOUT)) / file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The published folder at full size, with the repository's own statistics."""
    root = tmp_path_factory.mktemp("public")
    model = write_tmr_download(root, PUBLISHED)
    shutil.rmtree(root / "stats")
    shutil.copytree(Path(str(CHECKOUT)) / "stats", root / "stats")
    return model


@pytest.fixture(scope="module")
def distilbert(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_distilbert(tmp_path_factory.mktemp("distilbert"))


@pytest.fixture(scope="module")
def evaluator(folder: Path, distilbert: Path, tmp_path_factory: pytest.TempPathFactory) -> PublishedTMREvaluator:
    output = tmp_path_factory.mktemp("models") / "tmr"
    run_import("tmr", folder, output, text_encoder=distilbert, licence="LicenseRef-AMASS-NC")
    encoder = load_encoder("distilbert-base-uncased", distilbert)
    return PublishedTMREvaluator.load(Bundle.open(output), device="cpu", encoder=encoder)


@torch.inference_mode()
def test_motions(evaluator: PublishedTMREvaluator, folder: Path) -> None:
    network = public("src/model/actor.py").ACTORStyleEncoder(263, vae=True, num_layers=6).eval()
    network.load_state_dict(torch.load(folder / "last_weights" / "motion_encoder.pt"))
    stats = folder.parents[1] / "stats" / "humanml3d"
    normalizer = public("src/data/motion.py").Normalizer(str(stats / "guoh3dfeats"))
    rng = np.random.default_rng(5)
    motions = [rng.normal(scale=0.25, size=(frames, 263)).astype(np.float32) for frames in (40, 117, 199)]
    x = torch.nn.utils.rnn.pad_sequence([normalizer(torch.from_numpy(each)) for each in motions], batch_first=True)
    mask = torch.arange(199) < torch.tensor([40, 117, 199])[:, None]
    theirs = network({"x": x, "mask": mask})[:, 0]
    np.testing.assert_allclose(evaluator.embed_motion(motions), theirs.numpy(), atol=1e-4)


@torch.inference_mode()
def test_sentences(evaluator: PublishedTMREvaluator, folder: Path, distilbert: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "model")
    config = json.loads((folder / "config.json").read_text())
    config["data"]["text_to_token_emb"]["modelname"] = str(distilbert)
    (tmp_path / "model" / "config.json").write_text(json.dumps(config))
    theirs = public("demo/model.py").TMR_text_encoder(str(tmp_path / "model"))(SENTENCES)
    np.testing.assert_allclose(evaluator.embed_text(SENTENCES), theirs.numpy(), atol=1e-4)


def test_ranks() -> None:
    rng = np.random.default_rng(6)
    text = rng.normal(size=(200, 8))
    motion = text + rng.normal(size=(200, 8))
    unit = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (text, motion)]
    theirs = public("src/model/metrics.py").all_contrastive_metrics(unit[0] @ unit[1].T, rounding=None)
    ours = all_ranks(text, motion, distance="cosine")
    for prefix, ranks in (("t2m", ours.text_to_motion), ("m2t", ours.motion_to_text)):
        assert ranks.median == theirs[f"{prefix}/MedR"]
        for k, share in ranks.recall.items():
            assert 100 * share == pytest.approx(theirs[f"{prefix}/R{k:02}"])
