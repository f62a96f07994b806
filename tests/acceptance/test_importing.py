"""`marey models import`: from the folder of a download to a bundle that is used, and every refusal in one message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.core.settings import settings
from marey.evaluator.loading import load_evaluator
from tests.support.command import Command
from tests.support.tiny_encoders import write_tiny_t5
from tests.unit.evaluator.published import encoder_shapes

T5 = "t5-v1_1-base"


@pytest.fixture
def marey() -> Command:
    return Command({})


@pytest.fixture
def models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(settings(), "models", tmp_path / "models")
    monkeypatch.setattr(settings(), "home", tmp_path / "home")
    return tmp_path / "models"


@pytest.fixture
def t5(tmp_path: Path) -> Path:
    (tmp_path / "t5").mkdir()
    return write_tiny_t5(T5, tmp_path / "t5")


@pytest.fixture
def download(tmp_path: Path) -> Path:
    """A download of SnapMoGen's evaluator at its published sizes, with random numbers."""
    folder = tmp_path / "checkpoint_dir" / "snapmogen" / "evaluator" / "eval_klde-5_late-5_nlayer6_norm"
    (folder / "model").mkdir(parents=True)
    (folder / "evaluator.yaml").write_text("dim_pose: 148\n", encoding="utf-8")
    torch.manual_seed(0)
    state = {
        key: {name: torch.randn(shape) / 16 for name, shape in encoder_shapes(width).items()}
        for key, width in (("latent_enc", 148), ("text_enc", 768))
    }
    torch.save({**state, "ep": 1}, folder / "model" / "net_best_top1.tar")
    (tmp_path / "meta_data").mkdir()
    for name in ("mean", "std"):
        np.save(tmp_path / "meta_data" / f"{name}.npy", np.ones(296))
    return tmp_path / "checkpoint_dir"


def test_a_download_becomes_an_evaluator_with_its_text_encoder(
    marey: Command, models: Path, download: Path, t5: Path
) -> None:
    arguments = ("models", "import", "snapmogen-evaluator", download, "-o", models / "snap-eval")
    done = marey(*arguments)
    assert done.code == 3
    assert "--text-encoder" in done.err
    assert not models.exists() or not list(models.iterdir())

    done = marey(*arguments, "--text-encoder", t5)
    assert done.code == 0, done.err
    assert done.out.strip() == Bundle.open(models / "snap-eval").reference
    assert sorted(path.name for path in models.iterdir()) == ["snap-eval", T5]
    assert Bundle.open(models / "snap-eval").manifest.licence == "LicenseRef-Snap-NC"
    evaluator = load_evaluator("snap-eval", device="cpu")
    assert evaluator.embed_text(["a person walks"]).shape == (1, 256)

    again = marey(*arguments)
    assert again.code == 2
    assert "already exists" in again.err
    assert "--overwrite" in again.err
    assert marey(*arguments, "--overwrite", "--licence", "LicenseRef-Other-NC").code == 0
    assert Bundle.open(models / "snap-eval").manifest.licence == "LicenseRef-Other-NC"


def test_refusals_are_one_message_with_place_and_advice(marey: Command, models: Path, tmp_path: Path, t5: Path) -> None:
    unknown = marey("models", "import", "nope", tmp_path, "-o", models / "x")
    assert unknown.code == 3
    assert "t2m-evaluator" in unknown.err
    assert "snapmogen-evaluator" in unknown.err

    missing = marey("models", "import", "t2m-evaluator", tmp_path, "-o", models / "x")
    assert missing.code == 3
    assert "Comp_v6_KLD005/meta" in missing.err
    assert str(tmp_path) in missing.err

    unread = marey("models", "import", "t2m-evaluator", tmp_path, "-o", models / "x", "--text-encoder", t5)
    assert unread.code == 2
    assert "--text-encoder: the kind 't2m-evaluator' reads no text encoder" in unread.err

    wrong = marey("models", "import", "t5-base", t5, "-o", models / "t5-base")
    assert wrong.code == 2
    assert "gated-gelu" in wrong.err
    assert "google-t5/t5-base" in wrong.err
    assert not models.exists() or not list(models.iterdir())
