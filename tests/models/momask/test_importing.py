"""Import of a folder as downloaded: every tensor arrives, faults have one message, and nothing half written stays."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidFile, InvalidInput, MareyError, NotFound
from marey.generation.export import finish
from marey.generation.port import Request
from marey.importing import run_import
from marey.models.momask.bundle import load_networks
from marey.models.momask.generate import Generator, SamplingSettings
from marey.motion import read_bvh, write_bvh
from marey.text.pipeline import TextPipeline
from tests.models.momask.download import (
    MASKED,
    RESIDUAL,
    RVQ,
    transformer_options,
    vq_options,
    write_download,
    write_options,
)
from tests.models.momask.public import FULL, SMALL, Sizes
from tests.support.marey import Marey
from tests.support.tiny_encoders import write_tiny_clip


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_clip(tmp_path_factory.mktemp("clip"))


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder `checkpoints/t2m` at small size; not to be changed."""
    return write_download(tmp_path_factory.mktemp("public"), SMALL)


@pytest.fixture
def folder(published: Path, tmp_path: Path) -> Path:
    """A copy to break."""
    return Path(shutil.copytree(published, tmp_path / "checkpoints" / "t2m"))


@pytest.fixture(scope="module")
def bundle(published: Path, clip: Path, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return run_import("momask", published, tmp_path_factory.mktemp("models") / "momask-t2m", text_encoder=clip)


def checkpoint(folder: Path, part: str, file: str) -> dict[str, Any]:
    return torch.load(folder / part / "model" / file, weights_only=True)


def change(folder: Path, part: str, file: str, edit: Callable[[dict[str, Any]], object]) -> None:
    entries = checkpoint(folder, part, file)
    edit(entries)
    torch.save(entries, folder / part / "model" / file)


def test_the_bundle_holds_the_public_tensors_and_options(bundle: Bundle, published: Path) -> None:
    config, networks = load_networks(bundle)
    assert (config.masked.heads, config.masked.layers, config.residual.width) == (2, 2, 16)
    assert (config.tokenizer.levels, config.tokenizer.codes, config.shared) == (4, 24, True)
    masked = checkpoint(published, MASKED, "latest.tar")["t2m_transformer"]
    assert torch.equal(
        networks.masked.state_dict()["sequence.transformer.blocks.1.attention.qkv.weight"],
        masked["seqTransEncoder.layers.1.self_attn.in_proj_weight"],
    )
    rvq = checkpoint(published, RVQ, "net_best_fid.tar")["vq_model"]
    assert torch.equal(networks.tokenizer.codebooks[2], rvq["quantizer.layers.2.codebook"])
    assert torch.equal(networks.tokenizer.decoder.out_proj.weight, rvq["decoder.model.6.weight"])
    mean, std = (np.load(published / RVQ / "meta" / f"{name}.npy") for name in ("mean", "std"))
    np.testing.assert_array_equal(networks.tokenizer.mean.numpy(), mean)
    np.testing.assert_array_equal(networks.tokenizer.std.numpy(), std)


def test_the_manifest_says_where_weights_and_text_come_from(bundle: Bundle) -> None:
    manifest = bundle.manifest
    assert not manifest.commercial
    assert not manifest.random
    assert manifest.text is not None
    assert (manifest.text.encoder, manifest.text.width, manifest.text.labeller) == ("clip-vit-b32", 512, "none")
    assert manifest.text.encoder_sha256
    files = {each["file"]: each["tensors"] for each in manifest.training["files"]}
    assert files[f"{MASKED}/model/latest.tar"] == 36 - 1  # without positions
    assert f"{RVQ}/meta/std.npy" in files
    assert "positions, computed anew" in (bundle.path / "README.md").read_text()


def test_a_prompt_becomes_a_bvh_file(bundle: Bundle, clip: Path, tmp_path: Path) -> None:
    assert bundle.manifest.text is not None
    pipeline = TextPipeline.load(bundle.manifest.text, encoder_path=clip)
    generator = Generator.load(bundle, device="cpu")
    features = pipeline.features(["a person walks left", "a person waves"])
    requests = [Request(text, 1, 60) for text in features]
    made = generator.generate(requests)
    assert made[0] is not None
    assert made[1] is not None
    assert not np.array_equal(made[0].tokens, made[1].tokens)
    assert generator.frames(replace(requests[0], frames=None)) >= 16
    clip_made = finish(generator, requests[0], made[0], SamplingSettings())
    write_bvh(tmp_path / "walk.bvh", clip_made)
    joints = read_bvh(tmp_path / "walk.bvh").joints()
    assert len(joints) == clip_made.frames
    assert np.isfinite(joints).all()


@pytest.mark.parametrize("place", ["checkpoints/t2m", "checkpoints", "."])
def test_the_folder_may_be_named_from_above(published: Path, clip: Path, tmp_path: Path, place: str) -> None:
    root = published.parent.parent
    assert run_import("momask", root / place, tmp_path / "a", text_encoder=clip).manifest.config == "t2m"


def test_kit_with_separate_tables_is_imported(clip: Path, tmp_path: Path) -> None:
    folder = write_download(tmp_path, replace(SMALL, features=251), data_set="kit", shared=False)
    made = run_import("momask", folder, tmp_path / "models" / "kit", text_encoder=clip, licence="CC-BY-4.0")
    config, networks = load_networks(made)
    assert (config.layout, config.fps, config.inference.guidance) == ("kit-251", 12.5, 2.0)
    assert (made.manifest.licence, config.shared) == ("CC-BY-4.0", False)
    tensors = checkpoint(folder, f"{RESIDUAL}_k", "net_best_fid.tar")["res_transformer"]
    assert torch.equal(networks.residual.table(2), 2 * tensors["output_proj_weight"][1])
    assert torch.equal(networks.residual.bias, tensors["output_proj_bias"][:3])


def test_a_text_encoder_is_needed(published: Path, tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="clip-vit-b32"):
        run_import("momask", published, tmp_path / "models" / "a")
    assert not (tmp_path / "models" / "a").exists()


def nan(entries: dict[str, Any]) -> None:
    entries["res_transformer"]["cond_emb.weight"][0, 0] = torch.nan


def options(folder: Path, part: str, **changes: Any) -> None:
    values = vq_options(SMALL) if part == RVQ else transformer_options(SMALL, share_weight=part == RESIDUAL)
    values |= changes
    write_options(folder / part / "opt.txt", {key: value for key, value in values.items() if value != "absent"})


FAULTS: dict[str, tuple[Callable[[Path], object], type[MareyError], str]] = {
    "no residual transformer": (lambda f: shutil.rmtree(f / RESIDUAL), NotFound, "residual transformer is missing"),
    "no length estimator": (lambda f: shutil.rmtree(f / "length_estimator"), NotFound, "length estimator is missing"),
    "another tokenizer": (lambda f: (f / RVQ).rename(f / "rvq_x"), NotFound, "RVQ-VAE is missing"),
    "no normalisation": (lambda f: shutil.rmtree(f / RVQ / "meta"), NotFound, "no such file"),
    "no options": (lambda f: (f / MASKED / "opt.txt").unlink(), NotFound, "no such file"),
    "two residual transformers": (
        lambda f: shutil.copytree(f / RESIDUAL, f / "tres_other"), InvalidInput, "several of the residual transformer",
    ),
    "no heads": (lambda f: options(f, MASKED, n_heads="absent"), InvalidFile, "has no 'n_heads'"),
    "other heads": (lambda f: options(f, RESIDUAL, n_heads=3), InvalidFile, "3 heads do not divide a width of 16"),
    "many layers": (lambda f: options(f, MASKED, n_layers=10**9), InvalidFile, "n_layers: 1000000000 is outside"),
    "more layers": (lambda f: options(f, MASKED, n_layers=3), InvalidFile, r"lacks the tensor .*layers\.2"),
    "fewer layers": (lambda f: options(f, MASKED, n_layers=1), InvalidFile, "does not know: .* and 7 more"),
    "other sharing": (lambda f: options(f, RESIDUAL, share_weight=False), InvalidFile, "lacks the tensor token_embed"),
    "shared codebook": (lambda f: options(f, RVQ, shared_codebook=True), InvalidFile, "shared_codebook: is 'True'"),
    "a norm": (lambda f: options(f, RVQ, vq_norm="LN"), InvalidFile, "vq_norm: is 'LN'"),
    "another rate": (lambda f: options(f, RVQ, stride_t=4), InvalidFile, "stride_t: is '4', not 2"),
    "tokenizers that differ": (lambda f: options(f, RESIDUAL, vq_name="rvq_x"), InvalidFile, "vq_name: is 'rvq_x'"),
    "a tokenizer elsewhere": (lambda f: options(f, MASKED, vq_name="../x"), InvalidFile, "cannot be the name"),
    "kit's transformer": (lambda f: options(f, MASKED, dataset_name="kit"), InvalidFile, "is 'kit', not 't2m'"),
    "kit's tokenizer": (lambda f: options(f, RVQ, dataset_name="kit"), InvalidFile, "is 'kit', not 't2m'"),
    "kit's statistics": (
        lambda f: np.save(f / RVQ / "meta" / "std.npy", np.ones(251, np.float32)), InvalidFile, r"\(251,\), not \(263",
    ),
    "NaN": (lambda f: change(f, RESIDUAL, "net_best_fid.tar", nan), InvalidFile, "cond_emb.weight holds NaN"),
    "an unknown tensor": (
        lambda f: change(f, MASKED, "latest.tar", lambda e: e["t2m_transformer"].update(extra=torch.ones(1))),
        InvalidFile, r"tensors that this import does not know: t2m_transformer\.extra",
    ),
    "another wrapper": (
        lambda f: change(f, MASKED, "latest.tar", lambda e: e.update(model=e.pop("t2m_transformer"))),
        InvalidFile, "has no 't2m_transformer' or 'trans'",
    ),
    "a truncated file": (
        lambda f: (f / MASKED / "model" / "latest.tar").write_bytes(
            (f / MASKED / "model" / "latest.tar").read_bytes()[:5000]
        ),
        InvalidFile, "truncated",
    ),
    "a pickled class": (
        lambda f: torch.save({"estimator": Path("x")}, f / "length_estimator" / "model" / "finest.tar"),
        InvalidFile, "holds code or objects of Python",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_and_leaves_nothing(folder: Path, clip: Path, tmp_path: Path, fault: str) -> None:
    damage, kind, message = FAULTS[fault]
    damage(folder)
    models = tmp_path / "models"
    with pytest.raises(kind, match=message):
        run_import("momask", folder, models / "a", text_encoder=clip)
    assert not models.exists() or not any(models.iterdir())


def test_a_text_encoder_of_another_width_is_refused(published: Path, clip: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(clip, tmp_path / "clip"))
    config = (other / "config.json").read_text().replace('"hidden_size": 512', '"hidden_size": 768')
    (other / "config.json").write_text(config)
    models = tmp_path / "models"
    with pytest.raises(InvalidFile, match="CLIP ViT-B/32"):
        run_import("momask", published, models / "a", text_encoder=other)
    assert not models.exists() or not any(models.iterdir())


def test_a_folder_with_both_data_sets_is_refused(published: Path, clip: Path, tmp_path: Path) -> None:
    shutil.copytree(published, tmp_path / "checkpoints" / "t2m")
    (tmp_path / "checkpoints" / "kit").mkdir()
    with pytest.raises(InvalidInput, match="two data sets"):
        run_import("momask", tmp_path / "checkpoints", tmp_path / "a", text_encoder=clip)


def test_weights_of_the_text_encoder_are_left_out(folder: Path, clip: Path, tmp_path: Path) -> None:
    change(
        folder, MASKED, "latest.tar", lambda e: e["t2m_transformer"].update({"clip_model.ln_final.bias": torch.ones(4)})
    )
    made = run_import("momask", folder, tmp_path / "models" / "a", text_encoder=clip)
    assert "the text encoder, installed apart" in (made.path / "README.md").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(("data_set", "shared"), [("t2m", True), ("kit", False)])
def test_full_size_checkpoints_become_motions_by_the_command_line(
    clip: Path, tmp_path: Path, data_set: str, shared: bool
) -> None:
    sizes: Sizes = replace(FULL, features={"t2m": 263, "kit": 251}[data_set])
    folder = write_download(tmp_path, sizes, data_set=data_set, shared=shared)
    marey = Marey(tmp_path / "home", tmp_path / "models")
    bundle = marey.models / "mine"
    marey("models", "import", "momask", folder, "-o", bundle, "--text-encoder", clip).ok()
    asked = ("--bundle", bundle, "--seed", 1, "--format", "bvh")
    marey("generate", "a person walks", *asked, "-o", tmp_path / "out").ok()
    (file,) = (tmp_path / "out").rglob("*.bvh")
    assert len(read_bvh(file).joints()) > 10
