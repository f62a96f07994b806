"""Import of published weights, from folders of the published names with tiny networks in them."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidFile, InvalidInput, MareyError, NotFound
from marey.generation.port import Request
from marey.importing import ImportRequest
from marey.models.momaskpp.bundle import load_networks
from marey.models.momaskpp.generate import Generator
from marey.models.momaskpp.importing import SETS, import_momaskpp
from marey.models.momaskpp.released import MASKED, TOKENIZER, renamed
from tests.models.momaskpp.published import drawn, masked_shapes, refiner_shapes, tokenizer_shapes
from tests.support.prepared import text_features
from tests.support.tiny_encoders import write_tiny_t5

CODES = 16


def small(index: int) -> Any:
    """A published set with tiny networks of the same structure."""
    config = SETS[index].config
    return replace(
        SETS[index],
        config=replace(
            config,
            tokenizer=replace(config.tokenizer, width=16, depth=1, codes=CODES, code_width=8),
            masked=replace(config.masked, layers=1, width=24, feedforward=16, embedding=8),
            refiner=replace(config.refiner, width=8 if config.has_refiner else 0, depth=1),
        ),
    )


SMALL = (small(0), small(1))
TOKENIZER_SIZES = {"width": 16, "code_width": 8, "depth": 1}
MASKED_SIZES = {"width": 24, "embedding": 8, "feedforward": 16, "layers": 1}


def save(file: Path, value: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    torch.save(value, file)


def write_transformer(folder: Path, positions: int, scales: int, heads: int, *, cross: bool) -> None:
    shapes = masked_shapes(CODES, positions, scales, cross=cross, **MASKED_SIZES)
    state = OrderedDict(drawn(shapes))
    save(folder / "model" / "net_best_fid.tar", {"t2m_transformer": state, "ep": 7})
    text = f"data:\n  name: snapmotion\nmodel:\n  n_heads: {heads}\n"
    (folder / "train_momaskplus.yaml").write_text(text, encoding="utf-8")


def write_statistics(folder: Path, features: int) -> None:
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    np.save(folder / "mean.npy", rng.normal(size=features))
    np.save(folder / "std.npy", rng.uniform(0.5, 2, features))


@pytest.fixture
def snapmogen(tmp_path: Path) -> Path:
    root = tmp_path / "checkpoint_dir" / "snapmogen"
    vq = root / "vq" / "hrvq_nq2_296"
    save(
        vq / "model" / "net_best_mpjpe.tar", {"model": drawn(tokenizer_shapes(296, CODES, **TOKENIZER_SIZES)), "ep": 1}
    )
    (vq / "residual_vqvae.yaml").write_text("training:\n  ema: true\n", encoding="utf-8")
    write_transformer(root / "momask_plus" / "momaskplus_ca", 120, 2, 8, cross=True)
    regressor = {"regressor": drawn(refiner_shapes(width=8, depth=1)), "opt_regressor": {"state": {}}, "ep": 1}
    save(root / "gmr" / "gmr_d292" / "model" / "best.tar", regressor)
    write_statistics(tmp_path / "meta_data", 296)
    return root


@pytest.fixture
def humanml3d(tmp_path: Path) -> Path:
    root = tmp_path / "checkpoint_dir" / "humanml3d"
    vq = root / "vq" / "hml_hrvq_nq4_263"
    save(vq / "model" / "net_best_fid.tar", {"vq_model": drawn(tokenizer_shapes(263, CODES, **TOKENIZER_SIZES))})
    (vq / "residual_vqvae_hml.yaml").write_text("training:\n  ema: false\n", encoding="utf-8")
    write_transformer(root / "momask_plus" / "hml_ca", 91, 4, 6, cross=True)
    write_transformer(root / "momask_plus" / "hml_ic", 91, 4, 6, cross=False)
    write_statistics(root / "Comp_v6_KLD005" / "meta", 263)
    return root


@pytest.fixture(scope="module")
def t5(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_t5("t5-v1_1-base", tmp_path_factory.mktemp("t5"))


def run(folder: Path, output: Path, t5: Path | None) -> Bundle:
    return import_momaskpp(ImportRequest("momaskpp", folder, output, "LicenseRef-Snap-NC", t5), SMALL)


def test_snapmogens_weights_become_a_bundle_with_its_refiner(snapmogen: Path, models: Path, t5: Path) -> None:
    run(snapmogen, models / "snap", t5)
    bundle = Bundle.open(models / "snap")
    assert not bundle.manifest.commercial
    assert (bundle.manifest.layout, bundle.manifest.fps) == ("snapmogen-296", 30)
    assert bundle.manifest.text is not None
    assert bundle.manifest.text.wording == "description"
    config, networks = load_networks(bundle)
    assert (config.masked.conditioning, config.masked.heads, config.tokenizer.layout) == (
        "cross-attention",
        8,
        "padded",
    )
    assert networks.refiner is not None
    mean = np.load(snapmogen.parents[1] / "meta_data" / "mean.npy").astype(np.float32)
    assert np.array_equal(networks.tokenizer.mean.numpy(), mean)
    ours = networks.tokenizer.state_dict()
    for name, value in renamed(drawn(tokenizer_shapes(296, CODES, **TOKENIZER_SIZES)), TOKENIZER).items():
        assert torch.equal(ours[name], value), name


def test_the_number_of_heads_is_that_of_the_file(snapmogen: Path, models: Path, t5: Path) -> None:
    file = snapmogen / "momask_plus" / "momaskplus_ca" / "train_momaskplus.yaml"
    file.write_text("model:\n  n_heads: 4\n", encoding="utf-8")
    run(snapmogen, models / "snap", t5)
    assert SMALL[0].config.masked.heads != 4
    assert load_networks(Bundle.open(models / "snap"))[0].masked.heads == 4


def test_a_transformer_of_humanml3d_is_named_and_generates(humanml3d: Path, models: Path, t5: Path) -> None:
    with pytest.raises(InvalidInput, match="several transformers: hml_ca, hml_ic") as told:
        run(humanml3d, models / "hml", t5)
    assert "hml_ca" in (told.value.hint or "")
    bundle = run(humanml3d / "momask_plus" / "hml_ic", models / "hml", t5)
    config, networks = load_networks(bundle)
    assert (config.masked.conditioning, config.masked.heads, networks.refiner) == ("in-context", 6, None)
    shapes = masked_shapes(CODES, 91, 4, cross=False, **MASKED_SIZES)
    ours = networks.masked.state_dict()
    assert all(torch.equal(ours[name], value) for name, value in renamed(drawn(shapes), MASKED).items())
    generator = Generator.load("hml", device="cpu")
    requests = [Request(replace(text_features(0, width=768)), 1, frames) for frames in (24, None)]
    short, open_length = generator.generate(requests)
    assert short is not None
    assert open_length is not None
    assert short.features.shape == (24, 263)
    assert len(open_length.features) in config.open_frames


def change(root: Path, name: str) -> None:
    """Damage a download of HumanML3D's weights."""
    transformer = root / "momask_plus" / "hml_ic"
    file = transformer / "model" / "net_best_fid.tar"
    if name == "statistics":
        (root / "Comp_v6_KLD005" / "meta" / "std.npy").unlink()
    elif name == "heads":
        (transformer / "train_momaskplus.yaml").write_text("model:\n  n_heads: 7\n", encoding="utf-8")
    elif name == "file":
        file.unlink()
    else:
        state = torch.load(file, weights_only=True)
        tensors = state["t2m_transformer"]
        if name == "layer":
            tensors["seqTransEncoder.layers.1.norm1.weight"] = torch.ones(24)
        elif name == "foreign":
            tensors["motion_head.weight"] = torch.ones(24)
        else:
            del tensors["cond_emb.bias"]
        torch.save(state, file)


@pytest.mark.parametrize(
    ("damage", "kind", "said"),
    [
        ("statistics", NotFound, "no such file"),
        ("heads", InvalidFile, r"heads cannot be used: \[7\]"),
        ("file", NotFound, "the transformer is missing"),
        ("layer", InvalidFile, "does not have, such as transformer.blocks.1.norm1.weight"),
        ("foreign", InvalidFile, "'motion_head.weight' that this network does not have"),
        ("missing", InvalidFile, "lacks the tensor words.project.bias"),
    ],
)
def test_bad_downloads_are_refused_and_leave_nothing(
    humanml3d: Path, models: Path, t5: Path, damage: str, kind: type[MareyError], said: str
) -> None:
    change(humanml3d, damage)
    with pytest.raises(kind, match=said):
        run(humanml3d / "momask_plus" / "hml_ic", models / "hml", t5)
    assert not (models / "hml").exists()


def test_one_of_both_sets_is_named(snapmogen: Path, humanml3d: Path, models: Path, t5: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="holds snapmogen and humanml3d"):
        run(snapmogen.parent, models / "both", t5)
    with pytest.raises(NotFound, match="holds neither snapmogen nor humanml3d"):
        run(tmp_path / "meta_data", models / "none", t5)
    assert humanml3d.parent == snapmogen.parent


@pytest.mark.slow
def test_weights_of_the_published_sizes_are_read_whole(tmp_path: Path, models: Path, t5: Path) -> None:
    root = tmp_path / "checkpoint_dir" / "humanml3d"
    vq = root / "vq" / "hml_hrvq_nq4_263"
    save(vq / "model" / "net_best_fid.tar", {"vq_model": drawn(tokenizer_shapes(263, 512))})
    (vq / "residual_vqvae_hml.yaml").write_text("training:\n  ema: false\n", encoding="utf-8")
    state = OrderedDict(drawn(masked_shapes(512, 91, 4, cross=False)))
    transformer = root / "momask_plus" / "hml_ic"
    save(transformer / "model" / "net_best_fid.tar", {"t2m_transformer": state})
    (transformer / "train_momaskplus_hml.yaml").write_text("model:\n  n_heads: 6\n", encoding="utf-8")
    write_statistics(root / "Comp_v6_KLD005" / "meta", 263)
    bundle = import_momaskpp(ImportRequest("momaskpp", root, models / "hml", "LicenseRef-Snap-NC", t5))
    assert sum(value.size for value in bundle.tensors("masked").values()) > 12_000_000
