"""TMR's published evaluator: its import from files of their names, and embeddings equal to the paper's arithmetic."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from marey.bundles import Bundle
from marey.core.errors import Conflict, InvalidFile, InvalidInput, MareyError, NotFound
from marey.evaluator.assembly import renew_reference
from marey.evaluator.loading import load_evaluator
from marey.evaluator.reference import RealClips
from marey.evaluator.tmr_published import PublishedTMREvaluator
from marey.importing import run_import
from marey.text.encoders import weights_sha256
from tests.support.prepared import write_prepared
from tests.support.tiny_encoders import write_tiny_distilbert
from tests.support.tmr_download import PUBLISHED, TINY, write_tmr_download, write_training_checkpoint

SENTENCES = ("a person walks", "A person Waves, and turns left slowly")
LICENCE = "LicenseRef-AMASS-NC"


@pytest.fixture(scope="module")
def distilbert(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_distilbert(tmp_path_factory.mktemp("distilbert"))


def run(folder: Path, output: Path, encoder: Path | None = None, *, overwrite: bool = False) -> Bundle:
    return run_import("tmr", folder, output, text_encoder=encoder, licence=LICENCE, overwrite=overwrite)


def written_out(state: dict[str, Tensor], sizes: dict[str, int], x: Tensor, valid: Tensor) -> Tensor:
    """The mean vector of an encoder by the layers of torch: two tokens before (B, S, D), positions, post-norm blocks,
    and the output of the first token."""
    width = sizes["latent_dim"]
    layer = nn.TransformerEncoderLayer(
        width, sizes["num_heads"], sizes["ff_size"], activation="gelu", batch_first=True, norm_first=False
    )
    stack = nn.TransformerEncoder(layer, sizes["num_layers"], enable_nested_tensor=False).eval()
    prefix = "seqTransEncoder."
    stack.load_state_dict({k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)})
    x = x @ state["projection.weight"].T + state["projection.bias"]
    x = torch.cat([state["tokens"].expand(len(x), -1, -1), x], 1)
    place = torch.arange(x.shape[1], dtype=torch.float64)[:, None]
    angle = place * math.e ** (-math.log(10_000) * torch.arange(0, width, 2, dtype=torch.float64) / width)
    positions = torch.stack([angle.sin(), angle.cos()], -1).flatten(1).float()
    valid = torch.cat([torch.ones(len(x), 2, dtype=torch.bool), valid], 1)
    with torch.inference_mode():
        return stack(x + positions, src_key_padding_mask=~valid)[:, 0]


@pytest.mark.parametrize("sizes", [TINY, PUBLISHED], ids=["tiny", "published"])
def test_embeddings_are_those_of_the_papers_networks(
    tmp_path: Path, models: Path, distilbert: Path, sizes: dict[str, int]
) -> None:
    from transformers import AutoTokenizer, DistilBertModel

    folder = write_tmr_download(tmp_path, sizes)
    run(folder, models / "tmr", distilbert)
    evaluator = load_evaluator("tmr", device="cpu")
    assert isinstance(evaluator, PublishedTMREvaluator)
    assert (evaluator.layout, evaluator.fps, evaluator.distance) == ("humanml3d-263", 20, "cosine")
    assert evaluator.width == sizes["latent_dim"]

    rng = np.random.default_rng(1)
    motions = [rng.normal(size=(frames, 263)).astype(np.float32) for frames in (200, 41)]
    mean, std = (torch.load(tmp_path / "stats/humanml3d/guoh3dfeats" / f"{name}.pt") for name in ("mean", "std"))
    padded = nn.utils.rnn.pad_sequence([(torch.from_numpy(m) - mean) / std for m in motions], batch_first=True)
    valid = torch.arange(200) < torch.tensor([200, 41])[:, None]
    state = torch.load(folder / "last_weights" / "motion_encoder.pt")
    expected = written_out(state, sizes, padded, valid)
    np.testing.assert_allclose(evaluator.embed_motion(motions), expected.numpy(), atol=2e-5)

    tokens = AutoTokenizer.from_pretrained(distilbert)(list(SENTENCES), return_tensors="pt", padding=True)
    assert tokens.attention_mask.sum(1).tolist()[0] < tokens.attention_mask.shape[1]
    with torch.inference_mode():
        read = DistilBertModel.from_pretrained(distilbert).eval()(tokens.input_ids, tokens.attention_mask)
    state = torch.load(folder / "last_weights" / "text_encoder.pt")
    expected = written_out(state, sizes, read.last_hidden_state, tokens.attention_mask.bool())
    np.testing.assert_allclose(evaluator.embed_text(SENTENCES), expected.numpy(), atol=2e-5)


def test_the_bundle_says_what_it_is_made_of(tmp_path: Path, models: Path, distilbert: Path) -> None:
    run(write_tmr_download(tmp_path), models / "tmr", distilbert)
    manifest = Bundle.open(models / "tmr").manifest
    assert (manifest.kind, manifest.model, manifest.licence) == ("evaluator", "tmr-published", LICENCE)
    assert not manifest.commercial
    assert manifest.text is not None
    assert (manifest.text.encoder, manifest.text.labeller) == ("distilbert-base-uncased", "none")
    assert manifest.text.encoder_sha256 == weights_sha256(distilbert)
    assert [source.name for source in manifest.data] == ["HumanML3D"]
    card = (models / "tmr" / "README.md").read_text(encoding="utf-8")
    tensors = 3 + 12  # of one layer
    for file, used in (("last_weights/motion_encoder.pt", tensors), ("last_weights/text_encoder.pt", tensors)):
        (line,) = [line for line in card.splitlines() if f"`{file}`" in line]
        assert line.endswith(f"| {used} |")
    assert "`config.json`" in card
    assert "stats/humanml3d/guoh3dfeats/std.pt`" in card
    assert "motion_decoder" not in card


@pytest.mark.parametrize("place", ["in the folder", "beside it", "above models"])
def test_parts_are_found_where_the_repository_and_its_users_have_them(
    tmp_path: Path, models: Path, distilbert: Path, place: str
) -> None:
    folder = write_tmr_download(tmp_path / "TMR")
    target = {"in the folder": folder, "beside it": folder.parent, "above models": tmp_path / "TMR"}[place]
    if target != tmp_path / "TMR":
        (tmp_path / "TMR" / "stats").rename(target / "stats")
    named = tmp_path / "TMR" if place == "above models" else folder
    assert run(named, models / "tmr", distilbert).manifest.model == "tmr-published"


def test_of_two_models_none_is_guessed_and_the_named_one_is_read_with_its_statistics(
    tmp_path: Path, models: Path, distilbert: Path
) -> None:
    write_tmr_download(tmp_path)
    kit = write_tmr_download(tmp_path, data="kitml")
    with pytest.raises(InvalidInput, match="several of the folder of the model: tmr_humanml3d_guoh3dfeats, tmr_kitml"):
        run(tmp_path, models / "tmr", distilbert)
    torch.save(torch.full((263,), 3.0), tmp_path / "stats/kitml/guoh3dfeats/mean.pt")
    bundle = run(kit, models / "tmr-kit", distilbert)
    assert [source.name for source in bundle.manifest.data] == ["KIT-ML"]
    assert bundle.manifest.layout == "humanml3d-263"
    np.testing.assert_array_equal(bundle.statistics()[0], np.full(263, 3, np.float32))


def test_the_checkpoint_of_a_training_gives_the_same_bundle(tmp_path: Path, models: Path, distilbert: Path) -> None:
    folder = write_tmr_download(tmp_path)
    first = run(folder, models / "extracted", distilbert)
    for file in (folder / "last_weights").iterdir():
        file.unlink()
    (folder / "last_weights").rmdir()
    write_training_checkpoint(folder)
    other = run(folder, models / "trained")
    for part in ("motion", "text"):
        tensors = first.tensors(part)
        assert tensors
        for name, value in tensors.items():
            np.testing.assert_array_equal(value, other.tensors(part)[name])
    card = (models / "trained" / "README.md").read_text(encoding="utf-8")
    assert "state_dict.motion_decoder.final_layer.weight` and 1 more: the decoder" in card
    assert "`callbacks`: state of the training" in card


def set_field(path: str, value: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        file = folder / "config.json"
        content = json.loads(file.read_text(encoding="utf-8"))
        *parents, last = path.split(".")
        inner = content
        for name in parents:
            inner = inner[name]
        inner[last] = value
        file.write_text(json.dumps(content), encoding="utf-8")

    return change


def set_tensor(name: str, value: Tensor | None, file: str = "motion_encoder") -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        path = folder / "last_weights" / f"{file}.pt"
        state = torch.load(path)
        if value is None:
            del state[name]
        else:
            state[name] = value
        torch.save(state, path)

    return change


def truncate(folder: Path) -> None:
    file = folder / "last_weights" / "text_encoder.pt"
    file.write_bytes(file.read_bytes()[:1000])


def pickle_code(folder: Path) -> None:
    torch.save(nn.Linear(2, 2), folder / "last_weights" / "text_encoder.pt")


def set_std(value: object) -> Callable[[Path], None]:
    return lambda folder: torch.save(value, folder.parents[1] / "stats/humanml3d/guoh3dfeats/std.pt")


def drop(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def drop_stats(folder: Path) -> None:
    (folder.parents[1] / "stats").rename(folder.parents[1] / "elsewhere")


NETWORK = "model.motion_encoder"
LOADER = "data.motion_loader"


@pytest.mark.parametrize(
    ("change", "kind", "said"),
    [
        (drop("config.json"), NotFound, r"the folder of the model is missing: there is no tmr_\*"),
        (drop("last_weights/text_encoder.pt"), NotFound, r"no last_weights/text_encoder\.pt"),
        (drop_stats, NotFound, r"the statistics of humanml3d is missing: there is no stats/humanml3d/guoh3dfeats or"),
        (truncate, InvalidFile, "truncated"),
        (pickle_code, InvalidFile, "holds code or objects of Python"),
        (set_tensor("tokens", torch.full((2, 16), math.nan)), InvalidFile, "tokens holds NaN"),
        (set_tensor("tokens", torch.ones(1, 16)), InvalidFile, r"tokens has shape \(1, 16\), not \(2, 16\)"),
        (set_tensor("projection.bias", None, "text_encoder"), InvalidFile, r"lacks the tensor projection\.bias"),
        (set_tensor("linear.weight", torch.ones(2)), InvalidFile, r"does not know: linear\.weight"),
        (set_std(torch.zeros(263)), InvalidFile, "deviations that are not above 0"),
        (set_std(torch.ones(251)), InvalidFile, r"shape \(251,\), not \(263\)"),
        (set_std({"std": torch.ones(263)}), InvalidFile, "holds dict, not one array of numbers"),
        (set_field("model._target_", "src.model.TEMOS"), InvalidFile, r"_target_: is 'src\.model\.TEMOS'"),
        (set_field(f"{NETWORK}.num_heads", 3), InvalidFile, "3 heads do not divide a width of 16"),
        (set_field(f"{NETWORK}.num_layers", 2), InvalidFile, "its encoders have different sizes"),
        (set_field(f"{NETWORK}.ff_size", 10**9), InvalidFile, "ff_size: 1000000000 is outside 1 to 8192"),
        (set_field(f"{NETWORK}.vae", False), InvalidFile, "vae: is 'False', not True"),
        (set_field(f"{NETWORK}.activation", "relu"), InvalidFile, "activation: is 'relu'"),
        (set_field(f"{NETWORK}.nfeats", 135), InvalidFile, "nfeats: is '135', not 263"),
        (set_field("model.text_encoder.nfeats", 4096), InvalidFile, "nfeats: is '4096', not 768"),
        (set_field(f"{LOADER}.fps", 30.0), InvalidFile, r"fps: is '30\.0', not 20\.0"),
        (set_field(f"{LOADER}.nfeats", 135), InvalidFile, "nfeats: is '135', not 263"),
        (set_field(f"{LOADER}.normalizer.base_dir", "stats/x/guoh3dfeats"), InvalidFile, "base_dir: is 'stats/x/"),
        (set_field(f"{LOADER}.normalizer.base_dir", "stats/kitml/smplrifke"), InvalidFile, "base_dir: is 'stats/kit"),
        (set_field("data.text_to_token_emb.modelname", "roberta-base"), InvalidFile, "modelname: is 'roberta-base'"),
    ],
)
def test_bad_downloads_are_refused_and_leave_nothing(
    tmp_path: Path, models: Path, change: Callable[[Path], None], kind: type[MareyError], said: str
) -> None:
    folder = write_tmr_download(tmp_path)
    change(folder)
    with pytest.raises(kind, match=said) as caught:
        run(folder, models / "tmr")
    assert caught.value.where
    assert not models.exists()


def test_the_licence_and_the_text_encoder_are_asked_for_and_nothing_is_replaced(
    tmp_path: Path, models: Path, distilbert: Path
) -> None:
    folder = write_tmr_download(tmp_path)
    with pytest.raises(InvalidInput, match="states no licence") as unlicensed:
        run_import("tmr", folder, models / "tmr", text_encoder=distilbert)
    assert unlicensed.value.argument == "licence"
    with pytest.raises(NotFound, match="distilbert-base-uncased") as caught:
        run(folder, models / "tmr")
    assert "--text-encoder" in str(caught.value.hint)
    assert not models.exists() or not list(models.iterdir())
    run(folder, models / "tmr", distilbert)
    assert sorted(path.name for path in models.iterdir()) == ["distilbert-base-uncased", "tmr"]
    with pytest.raises(Conflict):
        run(folder, models / "tmr")
    assert run(folder, models / "tmr", overwrite=True).manifest.model == "tmr-published"


def test_a_reference_of_real_clips_is_added(tmp_path: Path, models: Path, distilbert: Path) -> None:
    imported = run(write_tmr_download(tmp_path), models / "tmr", distilbert)
    made = renew_reference(imported, write_prepared(tmp_path / "prepared"), models / "tmr-test")
    assert (made.manifest.model, made.manifest.text) == ("tmr-published", imported.manifest.text)
    assert len(RealClips.of(made).split("test").motion)


@pytest.mark.slow
@pytest.mark.skipif(
    not (os.environ.get("MAREY_TMR_EVALUATOR") and os.environ.get("MAREY_HUMANML3D_MOTION")),
    reason="needs MAREY_TMR_EVALUATOR, an imported tmr of HumanML3D, and MAREY_HUMANML3D_MOTION, its 001034.npy",
)
def test_a_pair_has_the_score_that_the_project_states() -> None:
    evaluator = load_evaluator(Bundle.open(Path(os.environ["MAREY_TMR_EVALUATOR"])), device="cpu")
    motion = np.load(os.environ["MAREY_HUMANML3D_MOTION"]).astype(np.float32)
    sentence = "a man sets to do a backflips then fails back flip and falls to the ground"
    (text,), (made,) = evaluator.embed_text([sentence]), evaluator.embed_motion([motion])
    cosine = float(text @ made / np.linalg.norm(text) / np.linalg.norm(made))
    assert cosine / 2 + 0.5 == pytest.approx(0.96, abs=0.01)
