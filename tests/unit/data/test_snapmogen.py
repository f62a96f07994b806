"""From SnapMoGen's published folder to a prepared one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from marey.cli.main import app
from marey.core.errors import Conflict, InvalidFile, InvalidInput, NotFound
from marey.data.inspect import summarize
from marey.data.prepared import PreparedData
from marey.data.sampling import sampling_weights
from marey.data.snapmogen import joints_of, measure, prepare_snapmogen
from marey.motion.kinematics import forward_kinematics
from marey.motion.rig_features import SNAPMOGEN_296
from marey.motion.skeleton import SNAPMOGEN
from tests.support.rigged import rigged
from tests.support.snapmogen_folder import SPLITS, write_folder


@pytest.fixture
def published(tmp_path) -> Path:
    return write_folder(tmp_path / "published")


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> PreparedData:
    folder = tmp_path_factory.mktemp("snapmogen")
    prepare_snapmogen(write_folder(folder / "published"), folder / "out")
    return PreparedData.open(folder / "out")


def published_features(data: PreparedData, mid: str):
    return np.load(data.path.parent / "published" / "renamed_feats" / f"{mid}.npy")


def test_clips_keep_their_splits_and_frames(data):
    assert {split: tuple(clip.id for clip in data.split(split)) for split in SPLITS} == SPLITS
    clip = data.split("val")[0]
    np.testing.assert_array_equal(data.features(clip), published_features(data, "gp_00001")[150:300])
    assert (clip.length, clip.measured.seconds) == (150, 5.0)
    assert data.manifest.kinds == {"captured": 4, "mirrored": 1}
    assert (data.manifest.layout, data.manifest.fps, data.manifest.dim) == ("snapmogen-296", 30, 296)
    assert data.layout.skeleton is SNAPMOGEN


def test_the_licence_is_non_commercial(data):
    assert data.manifest.tier == "non-commercial"
    assert [(source.name, source.clips) for source in data.manifest.sources] == [("snapmogen", 4)]
    assert summarize(data).sources == ("SnapMoGen (Snap Inc. Non-Commercial Licence)",)


def test_captions_are_those_of_people_and_then_of_the_model(data):
    clip = data.split("train")[0]
    assert clip.captions[:2] == ("The person sways to the left in take gp_00001#0#150.", "A figure walks.")
    assert len(clip.captions) == 6
    assert data.caption_counts[0] == (6,), "one of six is drawn, each as often"


def test_a_mirror_image_has_the_captions_with_sides_exchanged(data):
    plain, mirror = data.split("train")[:2]
    assert mirror.mirrored
    assert mirror.captions[0] == plain.captions[0].replace("left", "right")
    assert mirror.measured.turn == pytest.approx(-plain.measured.turn, abs=0.2)


def test_all_clips_are_drawn_equally_often(data):
    np.testing.assert_allclose(sampling_weights(data.split("train")), 1 / 3)


def test_statistics_are_the_published_ones(data):
    folder = data.path.parent / "published" / "meta_data"
    mean, std = np.load(folder / "mean.npy"), np.load(folder / "std.npy")
    np.testing.assert_allclose(data.mean, mean, rtol=1e-6)
    assert std[148] == 0, "the root's own place"
    assert data.std[148] == pytest.approx(1e-4)
    np.testing.assert_allclose(data.std[std > 1e-3], std[std > 1e-3], rtol=1e-6)


def test_joints_are_those_of_the_features_and_one_more(data):
    for clip in data.clips:
        joints = data.joints(clip)
        assert joints.shape == (clip.length + 1, 24, 3)
        np.testing.assert_allclose(joints[:-1], data.layout.decode(data.features(clip)), atol=2e-3)


def test_the_last_pose_follows_from_the_velocities():
    rotations, root = rigged(3, 60, 0.4)
    whole = SNAPMOGEN_296.encode_pose(rotations, root)
    np.testing.assert_allclose(joints_of(whole[:-1]), SNAPMOGEN_296.decode_positions(whole), atol=1e-5)
    last = forward_kinematics(SNAPMOGEN, rotations, root)[-1]
    heights = joints_of(whole)[-1, :, 1]
    np.testing.assert_allclose(heights - heights[0], last[:, 1] - last[0, 1], atol=1e-5)


def test_travel_is_measured_in_metres_and_a_left_turn_is_positive():
    found = measure(SNAPMOGEN_296.encode_pose(*rigged(0, 121, turns=0.5)))  # half a turn to the left in four seconds
    assert found.seconds == 4
    assert found.turn == pytest.approx(180, abs=25)
    assert found.speed == pytest.approx(found.path / 4, abs=0.01)
    assert 1.0 < found.path < 6.0


def test_published_yaw_steps_of_a_whole_turn_change_nothing(published, tmp_path):
    file = published / "renamed_feats" / "ep_00003.npy"
    features = np.load(file)
    features[40, 0] += 2 * np.pi
    np.save(file, features)
    prepare_snapmogen(published, tmp_path / "out")
    wrapped = PreparedData.open(tmp_path / "out").split("test")[0]
    assert abs(wrapped.measured.turn) < 90


def test_float64_features_are_taken_over(published, tmp_path):
    file = published / "renamed_feats" / "ep_00003.npy"
    np.save(file, np.load(file).astype(np.float64))
    prepare_snapmogen(published, tmp_path / "out")
    assert PreparedData.open(tmp_path / "out").split("test")[0].length == 120


def spoil_features(folder: Path, mids: tuple[str, ...] = ("gp_00001", "m_gp_00001", "ep_00003")) -> None:
    for mid in mids:
        features = np.load(folder / "renamed_feats" / f"{mid}.npy")
        features[45, 7] = np.nan
        np.save(folder / "renamed_feats" / f"{mid}.npy", features)


def narrow(folder: Path) -> None:
    np.save(folder / "renamed_feats" / "gp_00001.npy", np.zeros((301, 263), np.float32))


def cut(folder: Path) -> None:
    file = folder / "renamed_feats" / "st2_00002.npy"
    np.save(file, np.load(file)[:200])


def write_train(text: str):
    return lambda folder: (folder / "data_split_info" / "train_ids.txt").write_text(text)


def write_captions(document: object):
    return lambda folder: (folder / "all_caption_clean.json").write_text(json.dumps(document))


def negative(folder: Path) -> None:
    np.save(folder / "meta_data" / "std.npy", -np.ones(296))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (spoil_features, "gp_00001.npy holds NaN or infinite numbers; 3 of 5 clips cannot be read"),
        (narrow, r"shape \(301, 263\), not \(any, 296\)"),
        (cut, "st2_00002#30#210 ends at frame 210, the file holds 200"),
        (write_train("gp_00001\n"), "'gp_00001' is not a clip"),
        (write_train("../x#0#100\n"), "is not a clip"),
        (write_train("gp_00001#100#100\n"), "ends before it starts"),
        (write_train("gp_00001#0#150\ngp_00001#150#300\n"), "is in train already"),
        (write_train("ep_00003#0#99\n"), "has no captions"),
        (write_captions([]), "not a JSON object"),
        (write_captions({"gp_00001#0#150": {"manual": "text"}}), "manual is not a list"),
        (write_captions({"gp_00001#0#150": {"manual": [], "gpt": [" "]}}), "holds no caption"),
        (write_captions({"gp_00001#0#150": {"manual": [3]}}), "not text"),
        (write_captions({"gp_00001#0#150": []}), "manual and gpt"),
        (negative, "negative deviation"),
    ],
)
def test_a_broken_folder_is_named_and_nothing_is_left(spoil, message, published, tmp_path):
    spoil(published)
    with pytest.raises(InvalidFile, match=message):
        prepare_snapmogen(published, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["published"]


@pytest.mark.parametrize(
    "file",
    ["all_caption_clean.json", "meta_data/mean.npy", "data_split_info/val_ids.txt"],
)
def test_a_missing_file_is_named(file, published, tmp_path):
    (published / file).unlink()
    with pytest.raises(NotFound) as error:
        prepare_snapmogen(published, tmp_path / "out")
    assert file in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_few_unreadable_clips_are_left_out_and_many_are_refused(published, tmp_path):
    (published / "renamed_feats" / "ep_00003.npy").unlink()
    spoil_features(published, ("st2_00002",))
    names = published / "data_split_info" / "train_ids.txt"
    names.write_text("\ufeff" + names.read_text().replace("\n", "\r\n\r\n") + "gp_00001#0#150\n")
    manifest = prepare_snapmogen(published, tmp_path / "out")
    assert manifest.left_out == {
        "ep_00003#0#120": "there is no renamed_feats/ep_00003.npy",
        "st2_00002#30#210": "renamed_feats/st2_00002.npy holds NaN or infinite numbers",
    }
    train = [clip.id for clip in PreparedData.open(tmp_path / "out").split("train")]
    assert train == ["gp_00001#0#150", "m_gp_00001#0#150"], "a name that a file repeats is one clip"
    (published / "renamed_feats" / "m_gp_00001.npy").unlink()
    with pytest.raises(NotFound, match="3 of 5 clips cannot be read"):
        prepare_snapmogen(published, tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_no_training_clip_and_a_folder_in_use_are_refused(published, tmp_path):
    (published / "data_split_info" / "train_ids.txt").write_text("")
    with pytest.raises(InvalidInput, match="no training clip"):
        prepare_snapmogen(published, tmp_path / "out")
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "mine").write_text("mine")
    with pytest.raises(Conflict):
        prepare_snapmogen(published, tmp_path / "used")


def test_the_command_line_prepares_and_inspects(published, tmp_path):
    run = CliRunner()
    made = run.invoke(app, ["data", "prepare", "snapmogen", str(published), "-o", str(tmp_path / "out")])
    assert made.exit_code == 0, made.output
    seen = run.invoke(app, ["data", "inspect", str(tmp_path / "out"), "--json"])
    assert json.loads(seen.stdout)["splits"] == {"train": 3, "val": 1, "test": 1, "compositional": 0}
    for arguments in (
        ["prepare", "snapmogen", str(published), "own", str(published), "-o", str(tmp_path / "b")],
        ["prepare", "snapmogen", str(published), "--speed", "0.1", "-o", str(tmp_path / "b")],
        ["pack", "snapmogen", str(published), "-o", str(tmp_path / "c")],
    ):
        refused = run.invoke(app, ["data", *arguments])
        assert refused.exit_code != 0
        assert "features" in str(refused.exception) + refused.output
    assert not (tmp_path / "b").exists()
