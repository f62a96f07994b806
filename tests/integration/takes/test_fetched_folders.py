"""The folder of a fetch: what is left of an earlier one, and what is there when one breaks off."""

from __future__ import annotations

import csv
import itertools
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from marey.cli.commands.fetch import fetch_job
from marey.client import Client, downloads
from marey.client.manifest import RECORD, remove_left, write_manifest
from marey.core.errors import InvalidFile
from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.walker import walker

NAMES = ("--name-template", "{name}")


@pytest.fixture
def job(api: LiveApi) -> str:
    """Twenty motions, made."""
    with api.client() as client:
        job = client.submit([{"prompt": f"a person walks {n} steps", "name": f"take{n:02}"} for n in range(20)])["id"]
    api.work()
    return job


def manifest(folder: Path) -> list[dict[str, str]]:
    with (folder / "manifest.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.suffix in (".npz", ".bvh"))


def rejected_after_a_fetch(marey: Command, job: str, folder: Path) -> list[str]:
    """A folder of kept takes, three of which are rejected then; the others' names."""
    ids = {m["name"]: m["id"] for m in marey("motions", "list", "--job", job, "--json").ok().lines}
    marey("motions", "keep", *ids.values()).ok()
    marey("fetch", job, "-o", folder, "--review", "kept", *NAMES).ok()
    marey("motions", "reject", *(ids[f"take{n:02}"] for n in range(3))).ok()
    return sorted(ids)[3:]


def test_files_of_takes_that_are_not_chosen_any_more_are_told_and_pruned(
    marey: Command, job: str, tmp_path: Path
) -> None:
    folder = tmp_path / "final"
    kept = rejected_after_a_fetch(marey, job, folder)
    for own in ("take00.txt", "mine.npz", "take00.npz.bak"):
        (folder / own).write_text("mine")
    for _ in range(2):  # said until they are gone, though the manifest has forgotten them
        ran = marey("fetch", job, "-o", folder, "--review", "kept", *NAMES).ok()
        assert f"6 files of earlier fetches of job {job}" in ran.err
        assert "--prune" in ran.err
        assert [row["name"] for row in manifest(folder)] == kept
        assert len(files(folder)) == 41
    ran = marey("fetch", job, "-o", folder, "--review", "kept", "--prune", *NAMES).ok()
    assert "6 files of earlier fetches" in ran.err
    assert files(folder) == sorted(["mine.npz", *(f"{name}.{kind}" for name in kept for kind in ("npz", "bvh"))])
    assert {"take00.txt", "take00.npz.bak", "manifest.csv"} < {path.name for path in folder.iterdir()}
    assert not (folder / RECORD).exists()
    assert "earlier" not in marey("fetch", job, "-o", folder, "--review", "kept", *NAMES).ok().err


def test_motions_with_one_of_several_reviews_are_fetched(marey: Command, job: str, tmp_path: Path) -> None:
    ids = {m["name"]: m["id"] for m in marey("motions", "list", "--job", job, "--json").ok().lines}
    some = sorted(ids)
    marey("motions", "keep", *(ids[name] for name in some[:2])).ok()
    marey("motions", "reject", ids[some[2]]).ok()
    marey("motions", "clear", *(ids[name] for name in some[3:])).ok()
    marey("fetch", job, "-o", tmp_path / "both", "--review", "kept", "--review", "rejected", *NAMES).ok()
    assert [row["name"] for row in manifest(tmp_path / "both")] == some[:3]
    ran = marey("fetch", job, "-o", tmp_path / "none", "--review", "rerolled", *NAMES).ok()
    assert f"no motion of job {job} is rerolled" in ran.err
    marey("fetch", job, "-o", tmp_path / "one", "--review", "rejected", *NAMES).ok()
    assert [row["name"] for row in manifest(tmp_path / "one")] == some[2:3]


def test_every_option_of_an_export_reaches_the_files(marey: Command, api: LiveApi, tmp_path: Path) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks", "name": "walk"}])["id"]
    api.work(walker(seconds=0.5).to_npz())
    options = ["--root-bone", "--in-place", "heading", "--tpose-frame"]
    marey("fetch", job, "-o", tmp_path, "--format", "bvh", *options, *NAMES).ok()
    assert (tmp_path / "walk.bvh").read_text().startswith("HIERARCHY\nROOT root")
    refused = marey("fetch", job, "-o", tmp_path / "a", "--format", "bvh", "--rest-pose", "a", *NAMES)
    refused.refused(2, "no A-pose is known of this skeleton")


def test_one_call_may_fetch_and_prune_and_a_take_that_is_kept_again_is_not_left(
    marey: Command, job: str, tmp_path: Path
) -> None:
    rejected_after_a_fetch(marey, job, tmp_path)
    marey("fetch", job, "-o", tmp_path, "--review", "kept", *NAMES).ok()
    assert "earlier" not in marey("fetch", job, "-o", tmp_path, *NAMES).ok().err
    assert not (tmp_path / RECORD).exists()
    marey("fetch", job, "-o", tmp_path, "--review", "kept", "--prune", *NAMES).ok()
    assert len(files(tmp_path)) == 34


def test_clips_of_another_job_in_the_folder_are_not_pruned(
    api: LiveApi, marey: Command, job: str, tmp_path: Path
) -> None:
    other = marey("submit", "a person hops", "--seed", 1).ok().out.strip()
    api.work()
    marey("fetch", other, "-o", tmp_path, *NAMES).ok()
    marey("fetch", job, "-o", tmp_path, *NAMES).ok()
    marey("fetch", job, "-o", tmp_path, "--review", "kept", "--prune", *NAMES).ok()
    assert files(tmp_path) == ["a-person-hops.bvh", "a-person-hops.npz"]
    assert [row["job"] for row in manifest(tmp_path)] == [other]


def test_names_of_a_manifest_do_not_lead_out_of_the_folder(marey: Command, job: str, tmp_path: Path) -> None:
    folder = tmp_path / "final"
    outside = tmp_path / "other.npz"
    outside.write_text("mine")
    marey("fetch", job, "-o", folder, "--format", "npz", *NAMES).ok()
    (folder / "sub").mkdir()
    (folder / "sub" / "deep.npz").write_text("mine")
    (folder / "notes.txt").write_text("mine")
    (folder / "out").symlink_to(tmp_path)
    (folder / "link.npz").symlink_to(outside)
    (folder / "dir.npz").mkdir()
    rows = manifest(folder)
    tricks = (
        "../other.npz",
        str(outside),
        "sub/../../other.npz",
        "out/other.npz",
        "notes.txt",
        "manifest.csv",
        "link.npz",
        "dir.npz",
        "..",
        "",
    )
    forged = [{**rows[0], "item": str(number), "npz": trick} for number, trick in enumerate(tricks)]
    left = write_manifest(folder, job, [*rows, *forged])
    assert left == []
    assert write_manifest(folder, job, rows[1:]) == [folder / "take00.npz"]
    remove_left(folder, [folder / "take00.npz"])
    assert (outside.read_text(), (folder / "sub" / "deep.npz").read_text()) == ("mine", "mine")
    assert (folder / "notes.txt").exists()
    assert (folder / "link.npz").is_symlink()
    assert len(files(folder)) == 21


@contextmanager
def breaking(error: BaseException) -> Iterator[None]:
    """In here a command is interrupted, or the disk is full, at its twelfth file."""
    left = itertools.count(11, -1)

    def fsync(file: int) -> None:
        if next(left) <= 0:
            raise error
        os.fsync(file)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(downloads, "os", SimpleNamespace(fsync=fsync))
        yield


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")], ids=["ctrl-c", "disk"])
def test_a_fetch_that_breaks_off_leaves_a_manifest_of_what_is_there_and_the_next_completes_it(
    api: LiveApi, marey: Command, job: str, tmp_path: Path, error: BaseException, capsys: pytest.CaptureFixture[str]
) -> None:
    with breaking(error), Client(api.url, api.key) as client, pytest.raises((KeyboardInterrupt, InvalidFile)):
        fetch_job(client, job, tmp_path, template="{name}")
    there = files(tmp_path)
    rows = manifest(tmp_path)
    assert 0 < len(rows) < 20
    assert all(row[kind] in there for row in rows for kind in ("npz", "bvh"))
    told = {row[kind] for row in rows for kind in ("npz", "bvh")}
    assert all(name.replace(".npz", ".bvh") not in there or name in told for name in there if name.endswith(".npz"))
    assert "11 of 40 files are there, and in manifest.csv" in capsys.readouterr().err
    marey("fetch", job, "-o", tmp_path, *NAMES).ok()
    assert (len(manifest(tmp_path)), len(files(tmp_path))) == (20, 40)


def test_a_fetch_of_more_that_breaks_off_keeps_the_lines_of_what_was_there(
    api: LiveApi, marey: Command, job: str, tmp_path: Path
) -> None:
    marey("fetch", job, "-o", tmp_path, "--format", "bvh", *NAMES).ok()
    with breaking(KeyboardInterrupt()), Client(api.url, api.key) as client, pytest.raises(KeyboardInterrupt):
        fetch_job(client, job, tmp_path, template="{name}")
    rows = {row["name"]: row for row in manifest(tmp_path)}
    assert len(rows) == 20
    assert {row["bvh"] for row in rows.values()} == {f"{name}.bvh" for name in rows}
    assert {bool(row["npz"]) for row in rows.values()} == {True, False}


@pytest.mark.parametrize(("format", "hint"), [("usd", "pip install 'marey[usd]'"), ("smplx", "SMPLX_NEUTRAL.npz")])
def test_formats_that_cannot_be_made_here_are_refused_before_anything_is_fetched(
    marey: Command, job: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, format: str, hint: str
) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    ran = marey("fetch", job, "-o", tmp_path / "out", "--format", "npz", "--format", format)
    assert (ran.code, hint in ran.err) == (2, True)
    assert not (tmp_path / "out").exists()
