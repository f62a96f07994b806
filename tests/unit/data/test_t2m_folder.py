"""From the published folders of HumanML3D, KIT-ML and CMP to prepared ones."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from marey.cli.main import app
from marey.core.errors import Conflict, InvalidFile, InvalidInput, NotFound
from marey.data.inspect import summarize
from marey.data.prepared import PreparedData
from marey.data.sampling import sampling_weights
from marey.data.t2m_captions import read_caption
from marey.data.t2m_folder import CMP_SET, HUMANML3D_SET, KIT_SET, joints_of, prepare_t2m
from marey.motion.features import HUMANML3D_263, KIT_251
from marey.training.joints import heading_joints, unit_of, world_joints
from marey.training.tokenizing import tokenizer_clips, tokenizer_weights
from tests.support.t2m_folder import FRAMES, SPLITS, swaying, write_folder


@pytest.fixture
def published(tmp_path: Path) -> Path:
    return write_folder(tmp_path / "published")


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    folder = tmp_path_factory.mktemp("humanml3d")
    prepare_t2m(HUMANML3D_SET, write_folder(folder / "published"), folder / "out")
    return PreparedData.open(folder / "out")


def features_of(data: PreparedData, name: str) -> np.ndarray:
    return np.load(data.path.parent / "published" / "new_joint_vecs" / f"{name}.npy")


def test_clips_keep_their_splits_and_frames(data: PreparedData) -> None:
    whole = {split: tuple(clip.id for clip in data.split(split) if not clip.cropped) for split in SPLITS}
    assert whole == SPLITS | {"train": ("000001", "M000001", "000002", "M000002")}
    for clip in data.clips:
        if not clip.cropped:
            np.testing.assert_array_equal(data.features(clip), features_of(data, clip.id))
    assert data.manifest.kinds == {"captured": 4, "cropped": 4, "mirrored": 3}
    assert (data.manifest.layout, data.manifest.fps, data.manifest.facing_sigma) == ("humanml3d-263", 20, 20)


def test_a_caption_with_times_is_a_clip_of_its_own(data: PreparedData) -> None:
    clips = {clip.id: clip for clip in data.split("train")}
    assert [name for name in clips if name.startswith("000001")] == ["000001", "000001#1#4", "000001#1#4-2"]
    crop = clips["000001#1#4"]
    assert (crop.captions, crop.length, crop.cropped) == (("he sways to the left",), 60, True)
    np.testing.assert_array_equal(data.features(crop), features_of(data, "000001")[20:80])
    assert clips["000001#1#4-2"].captions == ("he sways to the left again",)


def test_captions_are_the_published_ones_with_their_parts_of_speech(data: PreparedData) -> None:
    clips = {clip.id: clip for clip in data.clips}
    assert clips["000002"].captions == ("someone waves.", "a figure bends"), "times that are no numbers are 0"
    assert clips["000002"].tags == ("someone/PRON wave/VERB", "a/DET figure/NOUN bend/VERB")
    assert clips["M000001#1#4"].captions == ("he sways to the right",), "mirror images have captions of their own"
    assert clips["M000001"].mirrored


def test_what_is_not_used_is_recorded(data: PreparedData) -> None:
    assert data.manifest.left_out == {
        "000001#1#1.2": "it is not 40 to 199 frames long",
        "M000001#1#1.2": "it is not 40 to 199 frames long",
        "000005": "it is not 40 to 199 frames long",
    }
    assert summarize(data).left_out == {"it is not 40 to 199 frames long": 3}


def test_all_clips_are_drawn_equally_often_and_all_windows_by_the_tokenizer(data: PreparedData) -> None:
    train = data.split("train")
    np.testing.assert_allclose(sampling_weights(train), 1 / len(train))
    clips = tokenizer_clips(train, 4)
    assert [clip.id for clip in clips] == ["000001", "M000001", "000002", "M000002"], "pieces are windows already"
    np.testing.assert_allclose(tokenizer_weights(clips, 64), np.array([57, 57, 33, 33]) / 180)


def test_statistics_are_the_published_ones(data: PreparedData) -> None:
    folder = data.path.parent / "published"
    np.testing.assert_array_equal(data.mean, np.load(folder / "Mean.npy"))
    np.testing.assert_array_equal(data.std, np.maximum(np.load(folder / "Std.npy"), np.float32(1e-4)))


@pytest.mark.parametrize("layout", [HUMANML3D_263, KIT_251], ids=lambda each: each.name)
def test_joints_are_in_metres_and_the_last_pose_follows_from_the_velocities(layout) -> None:
    joints = layout.canonicalize(swaying(layout, 3, 60, turns=0.4))
    found = joints_of(layout.encode(joints), layout)
    assert found.shape == joints.shape
    flat = [0, 2]
    np.testing.assert_allclose(found[..., 1], joints[..., 1], atol=1e-4)
    np.testing.assert_allclose(found[-1, :, flat] - found[-1, :1, flat], joints[-1, :, flat] - joints[-1, :1, flat],
                               atol=1e-3)  # fmt: skip


@pytest.mark.parametrize("layout", [HUMANML3D_263, KIT_251], ids=lambda each: each.name)
def test_losses_on_joints_are_in_metres(layout) -> None:
    features = layout.encode(swaying(layout, 3, 40, turns=0.3))
    count, unit = len(layout.skeleton), unit_of(layout.name)
    found = world_joints(torch.from_numpy(features)[None], count, unit)[0]
    np.testing.assert_allclose(found, layout.decode(features), atol=1e-3)
    heights = heading_joints(torch.from_numpy(features)[None], count, unit)[0, ..., 1]
    np.testing.assert_allclose(heights, layout.decode(features)[..., 1], atol=1e-3)


def test_measures_are_in_metres_and_degrees_to_the_left(tmp_path: Path) -> None:
    for kind in (HUMANML3D_SET, KIT_SET):
        folder = write_folder(tmp_path / kind.terms.name, kind.layout)
        joints = swaying(kind.layout, 5, 101, turns=0.25)
        np.save(folder / "new_joint_vecs" / "000004.npy", kind.layout.encode(joints))
        prepare_t2m(kind, folder, tmp_path / f"{kind.terms.name}-out")
        measured = PreparedData.open(tmp_path / f"{kind.terms.name}-out").split("test")[0].measured
        assert measured.turn == pytest.approx(90, abs=20)
        assert measured.path == pytest.approx(100 / kind.layout.fps, rel=0.2), "a metre a second"


def test_kit_is_read_at_its_own_rate(tmp_path: Path) -> None:
    prepare_t2m(KIT_SET, write_folder(tmp_path / "kit", KIT_251), tmp_path / "out")
    data = PreparedData.open(tmp_path / "out")
    assert (data.manifest.layout, data.manifest.fps, data.manifest.dim) == ("kit-251", 12.5, 251)
    crop = next(clip for clip in data.clips if clip.id == "000001#1#4")
    assert crop.length == 50 - 12
    assert data.manifest.sources[0].tier == "non-commercial"


def test_a_few_unreadable_clips_are_left_out_and_many_are_refused(published: Path, tmp_path: Path) -> None:
    (published / "new_joint_vecs" / "000003.npy").unlink()
    (published / "texts" / "M000003.txt").unlink()
    manifest = prepare_t2m(HUMANML3D_SET, published, tmp_path / "two")
    assert manifest.left_out["000003"] == "there is no new_joint_vecs/000003.npy"
    assert manifest.left_out["M000003"] == "there is no texts/M000003.txt"
    assert not PreparedData.open(tmp_path / "two").split("val")
    spoil("000004")(published)
    with pytest.raises(NotFound, match=r"no new_joint_vecs/000003.npy; 3 of 8 clips cannot be read"):
        prepare_t2m(HUMANML3D_SET, published, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    more = [f"x{number}" for number in range(300)]
    for name in more:
        shutil.copy(published / "new_joint_vecs" / "M000003.npy", published / "new_joint_vecs" / f"{name}.npy")
        shutil.copy(published / "texts" / "000004.txt", published / "texts" / f"{name}.txt")
    (published / "test.txt").write_text("\n".join(more))
    manifest = prepare_t2m(HUMANML3D_SET, published, tmp_path / "out")
    assert manifest.kinds["captured"] == 2 + 300


def spoil(*names: str) -> Callable[[Path], object]:
    """Put a number that is none into the features of clips."""

    def spoiled(folder: Path) -> None:
        for name in names:
            features = np.load(folder / "new_joint_vecs" / f"{name}.npy")
            features[5, 7] = np.nan
            np.save(folder / "new_joint_vecs" / f"{name}.npy", features)

    return spoiled


def test_a_clip_whose_features_are_no_numbers_is_left_out(published: Path, tmp_path: Path) -> None:
    spoil("000002", "M000002")(published)
    manifest = prepare_t2m(HUMANML3D_SET, published, tmp_path / "out")
    assert manifest.left_out["M000002"] == "new_joint_vecs/M000002.npy holds NaN or infinite numbers"
    ids = [clip.id for clip in PreparedData.open(tmp_path / "out").split("train") if not clip.cropped]
    assert ids == ["000001", "M000001"]


def windows_text(text: str) -> str:
    return "\ufeff" + text.replace("\n", "\r\n")


def spaced(text: str) -> str:
    return "\n" + text.replace("\n", "\n\n  \n")


def repeated(text: str) -> str:
    first, _, rest = text.partition("\n")
    return text if "#" in text else f"{first}\n{first}\n{rest}"


@pytest.mark.parametrize("change", [windows_text, spaced, repeated])
def test_files_that_other_programs_wrote_are_read_alike(
    change: Callable[[str], str], data: PreparedData, published: Path, tmp_path: Path
) -> None:
    for file in (*published.glob("*.txt"), *published.glob("texts/*.txt")):
        file.write_bytes(change(file.read_text()).encode())
    prepare_t2m(HUMANML3D_SET, published, tmp_path / "out")
    assert PreparedData.open(tmp_path / "out").clips == data.clips


def test_a_caption_keeps_its_line_whatever_signs_it_holds(published: Path, tmp_path: Path) -> None:
    say("someone\u2028 waves\x85and\x0b bows##0#0")(published)
    prepare_t2m(HUMANML3D_SET, published, tmp_path / "out")
    clips = {clip.id: clip for clip in PreparedData.open(tmp_path / "out").clips}
    assert clips["000002"].captions == ("someone waves and bows",)


def say(line: str) -> Callable[[Path], object]:
    return lambda folder: (folder / "texts" / "000002.txt").write_text(line, encoding="utf-8")


def test_captions_are_read_from_the_right() -> None:
    read = read_caption("walks # then runs #walk/VERB and/or/CCONJ#0.5#2", where="here")
    assert (read.text, read.tags, read.start, read.end) == ("walks # then runs", "walk/VERB and/or/CCONJ", 0.5, 2.0)
    assert read_caption("untagged##0#0", where="here").tags == ""


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (spoil("000001", "M000001", "000003"), "3 of 8 clips cannot be read"),
        (lambda folder: np.save(folder / "new_joint_vecs" / "000001.npy", np.zeros((50, 251), np.float32)), "263"),
        (lambda folder: np.save(folder / "Std.npy", -np.ones(263, np.float32)), "negative deviation"),
        (lambda folder: (folder / "val.txt").write_text("000001"), "000001 is in train already"),
        (lambda folder: (folder / "val.txt").write_text("../000001"), "not the name of a clip"),
        (say("a person walks"), "000002.txt, line 1: is not a line|is not a line"),
        (say("a#a/DET#zero#0"), "is not a line"),
        (say("a#a/DET#0#inf"), "times"),
        (say("a#determiner#0#0"), "is not a line"),
        (say("#a/DET#0#0"), "is not a line"),
    ],
)
def test_a_broken_folder_is_named_and_nothing_is_left(
    spoil: Callable[[Path], object], message: str, published: Path, tmp_path: Path
) -> None:
    spoil(published)
    with pytest.raises(InvalidFile, match=message):
        prepare_t2m(HUMANML3D_SET, published, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["published"]


@pytest.mark.parametrize("file", ["Mean.npy", "train.txt"])
def test_a_missing_file_is_named(file: str, published: Path, tmp_path: Path) -> None:
    (published / file).unlink()
    with pytest.raises(NotFound) as error:
        prepare_t2m(HUMANML3D_SET, published, tmp_path / "out")
    assert file in str(error.value)


def test_no_training_clip_and_a_folder_in_use_are_refused(published: Path, tmp_path: Path) -> None:
    (published / "train.txt").write_text("")
    with pytest.raises(InvalidInput, match="no training clip"):
        prepare_t2m(CMP_SET, published, tmp_path / "out")
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "mine").write_text("mine")
    with pytest.raises(Conflict):
        prepare_t2m(CMP_SET, published, tmp_path / "used")


def test_clips_of_other_sets_are_written_as_before(data: PreparedData) -> None:
    clip = data.split("test")[0]
    assert "tags" in clip.model_dump_json()
    plain = clip.model_copy(update={"tags": (), "cropped": False})
    assert not {"tags", "cropped"} & set(plain.model_dump(mode="json"))


def test_the_command_line_prepares_and_inspects(published: Path, tmp_path: Path) -> None:
    run = CliRunner().invoke
    made = run(app, ["data", "prepare", "humanml3d", str(published), "-o", str(tmp_path / "out")])
    assert made.exit_code == 0, made.output
    assert "train 8 clips, val 2 clips, test 1 clips" in made.output
    shown = run(app, ["data", "inspect", str(tmp_path / "out"), "--clip", "000004", "--json"])
    assert '"a person crouches"' in shown.stdout
    assert f'"length": {FRAMES["000004"]}' in shown.stdout
    refused = run(app, ["data", "pack", "kit", str(published), "-o", str(tmp_path / "packs")])
    assert refused.exit_code == 2
    assert "published as features" in refused.stderr
