"""From a folder in the layout of HumanML3D or KIT-ML to trained bundles, by the commands that users type."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from marey.bundles import Bundle
from marey.cli.main import app
from marey.data.prepared import PreparedData
from marey.motion.features import HUMANML3D_263, KIT_251
from marey.training.texts import CaptionTexts
from tests.support.t2m_folder import write_folder
from tests.support.tiny_encoders import write_tiny_clip

KIT = 'layout = "kit-251"\nfeatures = 251\njoints = 21\nfps = 12.5\n'
HGM3 = 'preset = "tiny"\n{}[condition]\ntext_width = 512\nmax_actions = 4\nmax_specifics = 8\nstandardised = false\n'
MOGO = 'preset = "tiny"\nsplit_actions = false\nsteers = 0\n{}[condition]\ntext_width = 512\nstandardised = false\n'


def run(*words: object) -> None:
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, f"{words}\n{done.output}\n{done.exception}"


@pytest.fixture(scope="module", params=["humanml3d", "kit"])
def prepared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A prepared folder whose captions are read by CLIP, given by its path, and the labeller `light`."""
    folder = tmp_path_factory.mktemp(request.param)
    write_folder(folder / "published", KIT_251 if request.param == "kit" else HUMANML3D_263)
    (folder / "clip").mkdir()
    write_tiny_clip(folder / "clip")
    run("data", "prepare", request.param, folder / "published", "-o", folder / "data")
    run("data", "text", folder / "data", "--encoder", "clip-vit-b32", "--labeller", "light", "--as-written",
        "--weights", folder / "clip")  # fmt: skip
    return folder / "data"


def train(prepared: Path, model: str, text: str, tmp_path: Path) -> None:
    """Train all networks of a model, and check what its bundle says."""
    kit = prepared.parent.name.startswith("kit")
    (tmp_path / "mine.toml").write_text(text.format(KIT if kit else ""))
    chosen = (prepared, "--run", tmp_path / "run", "--config", tmp_path / "mine.toml")
    run("train", model, "all", *chosen, "--steps", "2", "--max-minutes", "5", "--threads", "1")
    run("train", model, "bundle", *chosen, "-o", tmp_path / "bundle")
    manifest = Bundle.open(tmp_path / "bundle").manifest
    assert manifest.layout == ("kit-251" if kit else "humanml3d-263")
    assert [source.name for source in manifest.data] == ["kit" if kit else "humanml3d"]
    assert manifest.licence == "CC-BY-NC-4.0"
    assert manifest.text is not None
    assert (manifest.text.encoder, manifest.text.labeller, manifest.text.in_order) == ("clip-vit-b32", "light", False)
    if model == "hgm3":
        assert (manifest.text.max_actions, manifest.text.max_specifics) == (4, 8)


def test_a_model_trains_on_each_published_folder(prepared: Path, tmp_path: Path) -> None:
    model, text = ("hgm3", HGM3) if prepared.parent.name.startswith("kit") else ("mogo", MOGO)
    train(prepared, model, text, tmp_path)


@pytest.mark.slow
def test_the_other_model_trains_on_each_published_folder(prepared: Path, tmp_path: Path) -> None:
    model, text = ("mogo", MOGO) if prepared.parent.name.startswith("kit") else ("hgm3", HGM3)
    train(prepared, model, text, tmp_path)


def test_mogo_trains_on_a_copy_of_the_folder_with_text_of_its_own_encoder(prepared: Path, tmp_path: Path) -> None:
    if prepared.parent.name.startswith("kit"):
        pytest.skip("the text is that of HumanML3D")
    (tmp_path / "clip").mkdir()
    write_tiny_clip(tmp_path / "clip", 768)
    shutil.copytree(prepared, tmp_path / "data")
    (tmp_path / "mine.toml").write_text(MOGO.format("").replace("512", "768"))
    chosen = ("--run", tmp_path / "run", "--config", tmp_path / "mine.toml")
    words = ["train", "mogo", "all", tmp_path / "data", *chosen, "--steps", 1, "--max-minutes", 5, "--threads", 1]
    refused = CliRunner().invoke(app, [str(word) for word in words])
    assert refused.exit_code == 2
    assert "texts have width 512; this configuration reads 768" in refused.stderr
    run("data", "text", tmp_path / "data", "--encoder", "clip-vit-l14", "--labeller", "none", "--as-written",
        "--weights", tmp_path / "clip")  # fmt: skip
    run(*words)
    run("train", "mogo", "bundle", tmp_path / "data", *chosen, "-o", tmp_path / "bundle")
    text = Bundle.open(tmp_path / "bundle").manifest.text
    assert text is not None
    assert (text.encoder, text.width, text.labeller) == ("clip-vit-l14", 768, "none")


def test_the_text_of_a_folder_names_encoder_and_labeller(prepared: Path) -> None:
    spec = CaptionTexts.load(PreparedData.open(prepared)).spec
    assert (spec.encoder, spec.width, spec.labeller, spec.in_order) == ("clip-vit-b32", 512, "light", False)
    assert spec.encoder_sha256
    for words, message in (
        (("--model", "hgm3-starter", "--encoder", "minilm"), "--model"),
        (("--encoder", "bert"), "clip-vit-l14"),
        (("--encoder", "clip-vit-l14", "--weights", prepared.parent / "clip"), "ViT-L/14"),
    ):
        refused = CliRunner().invoke(app, ["data", "text", str(prepared), *map(str, words)])
        assert refused.exit_code == 2
        assert message in refused.stderr


def test_data_of_another_layout_or_texts_of_another_reading_are_refused(prepared: Path, tmp_path: Path) -> None:
    other = "" if prepared.parent.name.startswith("kit") else KIT
    (tmp_path / "mine.toml").write_text(HGM3.format(other))
    words = ["train", "hgm3", "masked", str(prepared), "--run", str(tmp_path / "run"), "--steps", "1", "--config"]
    refused = CliRunner().invoke(app, [*words, str(tmp_path / "mine.toml")])
    assert refused.exit_code == 2
    assert "holds features of the layout" in refused.stderr
    mine = HGM3.format(KIT if not other else "").replace('"tiny"\n', '"tiny"\nin_order = true\n')
    (tmp_path / "mine.toml").write_text(mine)
    refused = CliRunner().invoke(app, [*words, str(tmp_path / "mine.toml")])
    assert "as written, prompts would not be" in refused.stderr
