"""A set with a share of another's training clips, and their captions as they were read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from marey.cli.main import app
from marey.core.errors import InvalidInput
from marey.data.manifest import MANIFEST
from marey.data.mix import drawn, mix
from marey.data.prepared import PreparedData
from marey.data.t2m_folder import CMP_SET, HUMANML3D_SET, KIT_SET, prepare_t2m
from marey.motion.features import KIT_251
from marey.training.mixing import mix_with_texts
from marey.training.texts import CaptionTexts, KnownCaptions
from tests.support.prepared import made_up_texts
from tests.support.t2m_folder import write_folder


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Prepared folders of both sets; their clips have the same names."""
    work = tmp_path_factory.mktemp("mix")
    published = write_folder(work / "published")
    prepare_t2m(HUMANML3D_SET, published, work / "humanml3d")
    prepare_t2m(CMP_SET, published, work / "cmp")
    return work / "humanml3d", work / "cmp"


def opened(folders: tuple[Path, Path]) -> tuple[PreparedData, PreparedData]:
    return PreparedData.open(folders[0]), PreparedData.open(folders[1])


def test_a_mix_holds_all_of_the_base_and_the_others_training_clips(folders: tuple[Path, Path], tmp_path: Path) -> None:
    base, other = opened(folders)
    mix(base, other, 1.0, tmp_path / "mix")
    made = PreparedData.open(tmp_path / "mix")
    names = [clip.id for clip in made.clips]
    assert names == [clip.id for clip in base.clips] + [f"cmp-{clip.id}" for clip in other.split("train")]
    assert len(set(names)) == len(names)
    for split in ("val", "test"):
        assert [clip.id for clip in made.split(split)] == [clip.id for clip in base.split(split)]
    np.testing.assert_array_equal(made.mean, base.mean)
    np.testing.assert_array_equal(made.std, base.std)
    sources = [(clip, base) for clip in base.clips] + [(clip, other) for clip in other.split("train")]
    for clip, (source, data) in zip(made.clips, sources, strict=True):
        np.testing.assert_array_equal(made.features(clip), data.features(source))
        np.testing.assert_allclose(made.joints(clip), data.joints(source), atol=1e-3)
        assert (clip.captions, clip.tags) == (source.captions, source.tags)
    assert [(source.name, source.clips) for source in made.manifest.sources] == [("humanml3d", 4), ("cmp", 2)]
    assert made.manifest.tier == "non-commercial"


def test_a_share_draws_clips_with_their_mirror_images_and_pieces(folders: tuple[Path, Path]) -> None:
    _, other = opened(folders)
    train = {clip.id for clip in other.split("train")}
    halves = set()
    for seed in range(6):
        half = {clip.id for clip in drawn(other, 0.5, seed)}
        assert half in ({n for n in train if "000001" in n}, {n for n in train if "000002" in n})
        halves.add(frozenset(half))
        assert half == {clip.id for clip in drawn(other, 0.5, seed)}
    assert len(halves) == 2
    assert drawn(other, 0.0, 0) == []
    assert drawn(other, 1.0, 0) == list(other.split("train"))


def test_without_a_share_the_mix_is_the_base(folders: tuple[Path, Path], tmp_path: Path) -> None:
    base, other = opened(folders)
    mix(base, other, 0.0, tmp_path / "mix")
    made = PreparedData.open(tmp_path / "mix")
    assert made.clips == base.clips
    assert made.manifest.sources == base.manifest.sources


@pytest.mark.parametrize("share", [-0.1, 1.1])
def test_a_share_is_of_the_training_clips(share: float, folders: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="not a share"):
        mix(*opened(folders), share, tmp_path / "mix")
    assert not (tmp_path / "mix").exists()


def test_other_features_terms_and_the_same_set_are_refused(folders: tuple[Path, Path], tmp_path: Path) -> None:
    base, _ = opened(folders)
    prepare_t2m(KIT_SET, write_folder(tmp_path / "published", KIT_251), tmp_path / "kit")
    with pytest.raises(InvalidInput, match="the layout is kit-251, not humanml3d-263"):
        mix(base, PreparedData.open(tmp_path / "kit"), 1.0, tmp_path / "mix")
    with pytest.raises(InvalidInput, match="both hold clips of humanml3d"):
        mix(base, base, 1.0, tmp_path / "mix")
    manifest = json.loads((folders[1] / MANIFEST).read_text())
    manifest["sources"][0] |= {"tier": "sharealike", "licence": "CC-BY-SA-4.0"}
    shared = tmp_path / "shared"
    shared.mkdir()
    for file in folders[1].iterdir():
        (shared / file.name).write_bytes(file.read_bytes())
    (shared / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(InvalidInput, match="share-alike"):
        mix(base, PreparedData.open(shared), 1.0, tmp_path / "mix")


def test_captions_that_were_read_are_not_read_again(folders: tuple[Path, Path], tmp_path: Path) -> None:
    base, other = opened(folders)
    for data in (base, other):
        made_up_texts([len(clip.all_captions) for clip in data.clips]).save(data.path)
    mix_with_texts(*folders, 1.0, tmp_path / "mix")
    made = PreparedData.open(tmp_path / "mix")
    texts = CaptionTexts.load(made)
    captions = [caption for clip in made.clips for caption in clip.all_captions]
    assert len(texts.first) == len(made.clips) + 1

    def sentence(read: CaptionTexts, row: int) -> np.ndarray:
        return read.strings[read.node_string[read.node_start[row]]]

    ours, known = KnownCaptions.load(base), KnownCaptions.load(made)
    for caption in captions:
        np.testing.assert_array_equal(sentence(texts, known.rows[caption]), sentence(ours.texts, ours.rows[caption]))
    for data in (base, other):
        (data.path / "texts.npz").unlink()


def test_the_command_line_mixes(folders: tuple[Path, Path], tmp_path: Path) -> None:
    words = ["data", "mix", *map(str, folders), "--share", "0.5", "--seed", "1", "-o", str(tmp_path / "mix")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert str(tmp_path / "mix") in result.output
    base, other = opened(folders)
    made = PreparedData.open(tmp_path / "mix")
    assert len(made.clips) == len(base.clips) + len(drawn(other, 0.5, 1))
    assert not (tmp_path / "mix" / "texts.npz").exists()
