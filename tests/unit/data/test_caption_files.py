"""`captions-*.csv` beside an index: several authors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput
from marey.core.hashing import sha256_of
from marey.data.build import build
from marey.data.caption_files import read_caption_files
from marey.data.dataset import DATASET, INDEX, SETS
from marey.data.index import UNUSED, Row, parse_index
from marey.data.pack import JointsPack
from marey.data.prepare import CaptureSet, pack_set
from marey.data.prepared import PreparedData
from marey.motion.kinematics import bone_lengths
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import bandai_bvh, walker

STUDIO = (SETS / "bandai-namco" / DATASET).read_text().replace('"bandai-namco"', '"studio"', 1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    out = tmp_path / "studio"
    out.mkdir()
    (out / "a.bvh").write_bytes(bandai_bvh(walker(4.0)))
    (out / DATASET).write_text(STUDIO)
    (out / INDEX).write_text("file,start,end,action,captions\na.bvh,0,90,walk,a person walks\na.bvh,90,100,none,\n")
    (out / "captions-x.csv").write_text('id,captions\na@0,"left foot first, walk | walk ahead"\na@90,stand\n')
    (out / "captions-y.csv").write_text("id,captions\na@0,Someone walks.\n")
    return out


@pytest.mark.usefixtures("few_gestures")
def test_captions_of_all_authors_join_those_of_the_index_and_the_manifest_names_them(folder: Path) -> None:
    pack = pack_set(CaptureSet.own(folder), processes=1)
    assert pack.clips[0].captions == (
        ("a person walks",),
        ("left foot first, walk", "walk ahead"),
        ("Someone walks.",),
    )
    pack.save(folder / "pack.npz")
    build([JointsPack.load(folder / "pack.npz")], folder / "out")
    data = PreparedData.open(folder / "out")
    files = ("captions-x.csv", "captions-y.csv")
    assert data.manifest.caption_files == {f"studio/{name}": sha256_of(folder / name) for name in files}
    captured, mirrored = (clip for clip in data.clips if not clip.made)
    assert captured.authors[:3] == mirrored.authors[:3] == (1, 2, 1)
    assert len(captured.authors) == 5  # the words of the vocabulary and sentences for the action come after them
    assert captured.captions[1] == "left foot first, walk"
    assert mirrored.captions[1] == "right foot first, walk"
    assert data.caption_counts == [clip.authors for clip in data.clips]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("id,captions\na@0,walk\nb,walk\n", r"x\.csv, line 3: the index has no clip 'b'"),
        ("id,captions\na@0,walk\na@0,go\n", "line 3: 'a@0' has a line already"),
        ("id,captions\na@0, | \n", "line 2: has no captions"),
        ("id,captions\na@0,walk,slowly\n", "line 2: has 3 cells, the header 2"),
        ("id;captions\na@0;walk\n", "its header is not id,captions\n.*separated by semicolons"),
        ("clip,captions\na@0,walk\n", "its header is not id,captions"),
    ],
)
def test_a_broken_caption_file_is_refused_with_its_line(folder: Path, text: str, says: str) -> None:
    (folder / "captions-x.csv").write_text(text)
    with pytest.raises(InvalidFile, match=says):
        CaptureSet.own(folder)


def rows_of(name: str) -> tuple[Row, ...]:
    return parse_index((SETS / name / INDEX).read_text(encoding="utf-8"), {}, name)


@pytest.mark.parametrize("name", sorted({path.parent.name for path in SETS.glob("*/captions-*.csv")}))
def test_every_clip_of_a_known_set_that_is_used_is_captioned(name: str) -> None:
    rows = rows_of(name)
    files = read_caption_files(SETS / name, rows)
    captioned = {clip for file in files for clip in file.captions}
    assert {row.id for row in rows if row.action != UNUSED} - captioned == set()


@pytest.mark.usefixtures("few_gestures")
def test_training_clips_come_slower_and_faster_too_and_are_said_so_truly(folder: Path) -> None:
    (folder / INDEX).write_text(
        "file,start,end,action,captions,split\n"
        "a.bvh,0,90,walk,walks 2 seconds|walks,train\na.bvh,90,100,none,,\na.bvh,10,70,walk,walks,test\n"
    )
    pack = pack_set(CaptureSet.own(folder), processes=1)
    build([pack], folder / "out", speed=0.2)
    data = PreparedData.open(folder / "out")
    found = {clip.id: clip for clip in data.clips if not clip.made and not clip.spliced}
    assert sorted(found) == sorted(f"{m}{n}" for m in ("", "M") for n in ("a@0", "a@0*0.8", "a@0*1.2", "a@10"))
    assert (found["a@0*0.8"].speed, found["a@0*1.2"].speed) == (0.8, 1.2)
    frames = found["a@0"].length
    assert found["a@0*0.8"].length == pytest.approx(frames / 0.8, abs=1)
    assert found["a@0*1.2"].length == pytest.approx(frames / 1.2, abs=1)
    assert found["a@0*1.2"].measured.speed == pytest.approx(1.2 * found["a@0"].measured.speed, rel=0.05)
    assert "walks 2 seconds" in found["a@0"].captions
    assert "walks 2 seconds" not in found["a@0*1.2"].captions
    captured, slower = (
        bone_lengths(data.joints(found[name]).astype(np.float64), HUMANML3D) for name in ("a@0", "a@0*0.8")
    )
    assert np.abs(slower - captured.mean(axis=0)).max() < 0.003
    assert {"captured": 2, "mirrored": 2, "retimed": 4}.items() <= data.manifest.kinds.items()
    with pytest.raises(InvalidInput, match="must be between 0"):
        build([pack], folder / "more", speed=0.9)
