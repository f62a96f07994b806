"""The chain of both papers at their published sizes, by the commands that users type: a step of each stage in small
batches, the bundles, and the protocol by a T2M evaluator of the public size. Slow: minutes of two cores, 6 GiB."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest
import torch
from typer.testing import CliRunner

from marey.bundles import Bundle
from marey.cli.main import app
from marey.core.settings import settings
from marey.evaluator import protocol
from marey.evaluator.protocol import ProtocolOptions
from marey.evaluator.t2m_import import import_t2m
from marey.evaluator.t2m_model import T2MConfig
from marey.importing import ImportRequest
from tests.support.t2m_evaluator import write_public_files
from tests.support.t2m_folder import write_folder_to_measure
from tests.support.tiny_encoders import write_tiny_clip

POOL = 4
BATCHES = "".join(f"[train_{stage}]\nbatch = 2\n" for stage in ("tokenizer", "masked", "residual", "length"))
HGM3 = f'preset = "paper"\n{BATCHES}'
MOGO = 'preset = "paper"\n[condition]\ntext_width = 512\n[train_tokenizer]\nbatch = 2\n[train_transformer]\nbatch = 2\n'
"""Texts as wide as those of the CLIP that HGM³ reads: the paper does not say which one MOGO reads."""

pytestmark = pytest.mark.slow


def run(*words: object) -> None:
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, f"{words}\n{done.output}\n{done.exception}"


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sizes")
    published = write_folder_to_measure(folder / "published")
    names = (published / "test.txt").read_text().splitlines()
    (published / "test.txt").write_text("\n".join(names[:POOL]))
    clip = folder / "home" / "models" / "clip-vit-b32"
    clip.mkdir(parents=True)
    write_tiny_clip(clip)
    run("data", "prepare", "humanml3d", published, "-o", folder / "data")
    run("data", "text", folder / "data", "--encoder", "clip-vit-b32", "--labeller", "light", "--as-written",
        "--weights", clip)  # fmt: skip
    return folder / "data"


@pytest.fixture(scope="module")
def evaluator(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    folder = tmp_path_factory.mktemp("t2m")
    files = write_public_files(folder / "files", T2MConfig())
    import_t2m(ImportRequest("t2m-evaluator", files, folder / "t2m", "none"))
    return Bundle.open(folder / "t2m")


@pytest.mark.parametrize(
    ("model", "text", "stages"),
    [
        ("hgm3", HGM3, {"tokenizer": (), "masked": (), "residual": (), "length": ()}),
        ("mogo", MOGO, {"tokenizer": (), "transformer": ("--micro-batch", 1, "--recompute")}),
    ],
    ids=["hgm3", "mogo"],
)
def test_the_chain_runs_at_the_published_sizes(
    model: str,
    text: str,
    stages: dict[str, tuple[object, ...]],
    prepared: Path,
    evaluator: Bundle,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "paper.toml").write_text(text)
    chosen = (prepared, "--run", tmp_path / "run", "--config", tmp_path / "paper.toml")
    for stage, options in stages.items():
        run("train", model, stage, *chosen, "--steps", 1, "--device", "cpu", *options)
    run("train", model, "bundle", *chosen, "-o", tmp_path / "bundle")
    bundle = Bundle.open(tmp_path / "bundle")
    codes, layers = {"hgm3": (512, 6), "mogo": (8192, 18)}[model]
    assert bundle.tensors("tokenizer")["quantizer.codebooks"].shape[:2] == (6, codes)
    network = bundle.manifest.parameters["masked" if model == "hgm3" else "transformer"]
    assert network["layers"] == layers

    monkeypatch.setattr(protocol, "ProtocolOptions", partial(ProtocolOptions, pool=POOL, prompts=0))
    monkeypatch.setattr(settings(), "home", prepared.parent / "home")  # where the weights of CLIP lie
    run("eval", "run", "--protocol", "humanml3d", "--bundle", bundle.path, "--evaluator", evaluator.path,
        "--data", prepared, "--repeats", 2, "--device", "cpu", "-o", tmp_path / "report")  # fmt: skip
    (first, _) = json.loads((tmp_path / "report" / "report.json").read_text())["repeats"]
    for row in ("reconstructed", "generated"):
        assert torch.isfinite(torch.tensor(list(first[evaluator.reference][row].values()))).all()
