"""Prompts in, motion out: the main path, through the real command line, server, queue, worker and store."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from marey.exporters.making import FileRecipe
from marey.motion.clip import load_npz
from marey.motion.export_options import ExportOptions
from marey.motion.io.bvh import read_bvh
from tests.support.marey import TINY, Marey, tiny
from tests.support.models import another_model

FIELDS = ["job", "item", "motion", "name", "prompt", "variant", "model", "bundle", "licence", "seed", "state", "error",
          "frames", "fps", "elapsed", "quality", "selection", "scope",
          "files"]  # fmt: skip


@pytest.fixture(scope="module")
def fetched(served: tuple[Marey, object], tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, object]]:
    """Output lines of a job of three motions."""
    table = "\ufeffprompt,name,seconds,seed,variants\na person walks forward,walk,2,7,2\nsomeone waves,,3,,\n"
    folder = tmp_path_factory.mktemp("fetched")
    return served[0]("submit", "-f", "-", "--fetch", folder, "--json", stdin=table).ok().lines


def test_every_item_has_its_line_in_input_order(fetched: list[dict[str, object]]) -> None:
    assert [list(line) for line in fetched] == [FIELDS] * 3
    assert [(line["prompt"], line["variant"], line["state"]) for line in fetched] == [
        ("a person walks forward", 0, "succeeded"),
        ("a person walks forward", 1, "succeeded"),
        ("someone waves", 0, "succeeded"),
    ]
    assert [line["seed"] for line in fetched[:2]] == [7, 8]
    assert {line["model"] for line in fetched} == {"hgm3"}
    assert all(str(line["bundle"]).startswith(f"{TINY}@") for line in fetched)


def test_files_are_named_by_index_name_and_seed(fetched: list[dict[str, object]]) -> None:
    names = [Path(line["files"]["bvh"]).name for line in fetched]
    assert names[:2] == ["00000_walk_7.bvh", "00000_walk_8.bvh"]
    assert names[2] == f"00001_someone-waves_{fetched[2]['seed']}.bvh"


def test_the_npz_and_the_bvh_hold_the_same_motion(fetched: list[dict[str, object]]) -> None:
    for line in fetched:
        clip = load_npz(line["files"]["npz"])
        bvh = read_bvh(line["files"]["bvh"])
        assert (clip.frames, clip.fps) == (line["frames"], line["fps"])
        assert clip.manifest["prompt"] == line["prompt"]
        assert clip.manifest["seed"] == line["seed"]
        assert clip.manifest["random_weights"] is True
        names = list(clip.skeleton.joint_names)
        order = [bvh.skeleton.joint_names.index(name) for name in names]
        assert np.abs(bvh.joints()[:, order] - clip.joints).max() < 1e-3


def test_a_one_shot_makes_the_same_tokens_as_the_queue(
    fetched: list[dict[str, object]], offline: Marey, tmp_path: Path
) -> None:
    line = fetched[1]
    made = offline(
        "generate", line["prompt"], "--seed", line["seed"], "--seconds", 2, "-o", tmp_path, "--format", "npz", "--json"
    ).ok().lines  # fmt: skip
    assert (made[0]["job"], made[0]["item"], list(made[0])) == (None, None, FIELDS)
    assert (made[0]["quality"], made[0]["scope"]) == (line["quality"], line["scope"])
    ours, theirs = load_npz(made[0]["files"]["npz"]), load_npz(line["files"]["npz"])
    # Each motion is decoded by itself, so equal tokens are equal numbers, in a batch of one or two.
    np.testing.assert_array_equal(ours.features, theirs.features)


def test_another_model_makes_motions_by_the_same_queue_and_alone(marey: Marey, offline: Marey, tmp_path: Path) -> None:
    model = another_model()
    table = f"prompt,model,seconds,seed\na person walks,{model},1,3\nsomeone waves,{model},,\n"
    queued = marey("submit", "-f", "-", "--fetch", tmp_path / "a", "--json", stdin=table).ok().lines
    alone = offline(
        "generate", "a person walks", "--model", model, "--seed", 3, "--seconds", 1, "-o", tmp_path / "b", "--json"
    ).ok().lines  # fmt: skip
    assert [line["model"] for line in (*queued, *alone)] == [model] * 3
    assert {str(line["bundle"]).partition("@")[0] for line in queued} == {tiny(model)}
    ours, theirs = load_npz(alone[0]["files"]["npz"]), load_npz(queued[0]["files"]["npz"])
    assert ours.frames == 20
    np.testing.assert_array_equal(ours.features, theirs.features)
    assert len(read_bvh(queued[1]["files"]["bvh"]).joints()) == queued[1]["frames"]


def test_fetching_again_changes_nothing_and_a_foreign_file_is_not_touched(marey: Marey, tmp_path: Path) -> None:
    job = marey.submit("a person bows", "--seed", 3, "--seconds", 2, "--name", "bow")
    marey("jobs", "wait", job).ok()
    paths = [Path(path) for path in marey("fetch", job, "-o", tmp_path / "a").ok().out.splitlines()]
    assert sorted(path.suffix for path in paths) == [".bvh", ".npz"]
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "a").iterdir()}
    marey("fetch", job, "-o", tmp_path / "a").ok()
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "a").iterdir()} == before

    bvh = next((tmp_path / "a").glob("*.bvh"))
    npz = next((tmp_path / "a").glob("*.npz"))
    content = bvh.read_bytes()
    bvh.write_text("mine")
    npz.unlink()
    marey("fetch", job, "-o", tmp_path / "a").refused(2, str(bvh), "holds something else", "--overwrite")
    assert bvh.read_text() == "mine"
    assert not npz.exists()
    marey("fetch", job, "-o", tmp_path / "a", "--overwrite").ok()
    assert bvh.read_bytes() == content


def test_a_broken_off_download_goes_on_where_it_stopped_and_a_wrong_one_begins_anew(
    marey: Marey, tmp_path: Path
) -> None:
    job = marey.submit("a person bows", "--seed", 4, "--seconds", 2)
    marey("jobs", "wait", job).ok()
    marey("fetch", job, "-o", tmp_path / "whole", "--name-template", "{seed}").ok()
    whole = {path.name: path.read_bytes() for path in (tmp_path / "whole").iterdir()}
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "4.npz.part").write_bytes(whole["4.npz"][:1000])
    (tmp_path / "parts" / "4.bvh.part").write_bytes(b"other" * 100)
    marey("fetch", job, "-o", tmp_path / "parts", "--name-template", "{seed}").ok()
    assert {path.name: path.read_bytes() for path in (tmp_path / "parts").iterdir()} == whole


def test_jsonl_with_settings_and_a_text_file_are_read_too(marey: Marey, tmp_path: Path) -> None:
    lines = [{"prompt": "a person jumps", "seconds": 2, "settings": {"guidance": 2.5, "steps": 4}, "tags": ["take 1"]}]
    (tmp_path / "p.jsonl").write_text("\n".join(map(json.dumps, lines)))
    (tmp_path / "p.txt").write_text("a person jumps\n\na person hops\n")
    made = (
        marey("submit", "-f", tmp_path / "p.jsonl", "--fetch", tmp_path / "o", "--format", "npz", "--json").ok().lines
    )
    settings = load_npz(made[0]["files"]["npz"]).manifest["settings"]
    assert (settings["guidance"], settings["steps"]) == (2.5, 4)
    assert list(made[0]["files"]) == ["npz"]
    job = marey.submit("-f", tmp_path / "p.txt", "--seconds", 2)
    assert marey("jobs", "show", job, "--json").ok().lines[0]["total"] == 2


def test_another_machine_needs_only_the_url_and_a_key(elsewhere: Marey, tmp_path: Path) -> None:
    made = elsewhere("submit", "a person turns", "--seconds", 2, "--fetch", tmp_path / "o", "--json").ok().lines
    assert made[0]["state"] == "succeeded"
    assert Path(made[0]["files"]["npz"]).is_file()


def test_prompts_with_emoji_and_accents_are_fine(marey: Marey, tmp_path: Path) -> None:
    prompts = ["a person waves 👋", "a café waiter bows, très chic"]
    made = marey("submit", *prompts, "--seconds", 2, "--fetch", tmp_path, "--format", "npz", "--json").ok().lines
    assert [line["prompt"] for line in made] == prompts


def test_a_dry_run_submits_nothing(marey: Marey) -> None:
    before = marey.jobs()
    ran = marey("submit", "a person waves", "--variants", 5, "--dry-run", "--json").ok()
    assert ran.lines[0]["items"] == 5
    assert marey.jobs() == before


def test_the_server_makes_files_for_a_machine_without_numpy(
    fetched: list[dict[str, object]], elsewhere: Marey, tmp_path: Path
) -> None:
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "numpy.py").write_text("raise ImportError('numpy is not installed')")
    small = replace(elsewhere, environment={**elsewhere.environment, "PYTHONPATH": str(tmp_path / "without")})
    line, target = fetched[0], tmp_path / "walk.glb"
    small("motions", "file", line["motion"], "glb", "-o", target, "--fps", 30, "--mesh", timeout=300).ok()
    wanted = FileRecipe("glb", ExportOptions(mesh=True), 30.0).make(Path(line["files"]["npz"]).read_bytes(), "walk")
    assert target.read_bytes() == wanted
    refused = small("motions", "file", line["motion"], "mp4", "-o", tmp_path / "walk.mp4", "--root-bone")
    refused.refused(2, "root_bone", "mp4 files have no such option")
    assert not (tmp_path / "walk.mp4").exists()
