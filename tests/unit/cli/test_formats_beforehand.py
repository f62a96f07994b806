"""Files that this process cannot write are refused before motions are made, submitted or edited; no folder is left."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.support.command import Command
from tests.support.walker import walker

CASES = [
    (("--format", "usd"), "pip install 'marey[usd]'"),
    (("--format", "npz", "--format", "mp4"), "pip install 'marey[video]'"),
    (("--format", "smplx"), "--rig SMPLX_NEUTRAL.npz"),
]


@pytest.fixture
def marey(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Return the command line where the extras `usd` and `video` are not installed."""
    for module in ("pxr", "av"):
        monkeypatch.setitem(sys.modules, module, None)
    return Command({"MAREY_HOME": str(tmp_path / "home"), "MAREY_SERVER": "http://127.0.0.1:9"})


@pytest.mark.parametrize(("options", "hint"), CASES)
@pytest.mark.parametrize(
    "command",
    [("generate", "a person walks", "--bundle", "hgm3-starter", "-o"), ("submit", "a person walks", "--fetch")],
)
def test_generate_and_submit(
    marey: Command, tmp_path: Path, command: tuple[str, ...], options: tuple[str, ...], hint: str
) -> None:
    ran = marey(*command, tmp_path / "out", *options)
    assert (ran.code, ran.out) == (2, "")
    assert hint in ran.err
    assert not (tmp_path / "out").exists()


KNOWN = "bvh, fbx, gif, glb, mp4, npz, smplx, usd, vrma, webp"


@pytest.mark.parametrize(
    ("command", "hint"),
    [
        (("generate", "a person walks", "--bundle", "hgm3-starter", "-o"), f"Known: {KNOWN}."),
        (("submit", "a person walks", "--fetch"), f"Known: {KNOWN}. One that only the server has:"),
    ],
)
def test_a_format_that_is_not_known(marey: Command, tmp_path: Path, command: tuple[str, ...], hint: str) -> None:
    ran = marey(*command, tmp_path / "out", "--format", "npz", "--format", "BHV")
    assert (ran.code, ran.out) == (2, "")
    assert f"--format: 'BHV' is not a known motion format (did you mean 'bvh'?)\n  {hint}" in ran.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "value"), [("--format", "bwh"), ("--format", "glb"), ("--body", "hero"), ("--name-template", "{seed}")]
)
@pytest.mark.parametrize("more", [(), ("--watch",), ("--dry-run",)])
def test_submit_refuses_options_of_files_that_it_does_not_fetch(
    marey: Command, option: str, value: str, more: tuple[str, ...]
) -> None:
    ran = marey("submit", "a person walks", option, value, *more)
    assert (ran.code, ran.out) == (2, "")
    assert f"{option}: acts on files that are fetched, and none are" in ran.err
    assert f"Add --fetch FOLDER, or leave it to `marey fetch JOB {option} " in ran.err


def test_submit_refuses_a_time_limit_where_it_does_not_wait(marey: Command) -> None:
    ran = marey("submit", "a person walks", "--timeout", 3)
    assert (ran.code, ran.out) == (2, "")
    assert "--timeout: limits the time of waiting, and nothing is waited for\n  Add --watch or --fetch" in ran.err


def test_a_rig_that_is_no_model_of_smplx(marey: Command, tmp_path: Path) -> None:
    options = ("--format", "smplx", "--rig", "mixamo")
    ran = marey("generate", "a person walks", "--bundle", "hgm3-starter", "-o", tmp_path / "out", *options)
    assert (ran.code, "rest joints of the SMPL-X model" in ran.err) == (2, True)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("options", "hint"), CASES)
def test_edit(marey: Command, tmp_path: Path, options: tuple[str, ...], hint: str) -> None:
    walker().save_npz(tmp_path / "walk.npz")
    ran = marey("edit", tmp_path / "walk.npz", "--mirror", "-o", tmp_path / "out", *options[-2:])
    assert (ran.code, hint in ran.err) == (2, True)
    assert not (tmp_path / "out").exists()


def test_convert_says_it_before_it_reads_the_source(marey: Command, tmp_path: Path) -> None:
    ran = marey("convert", tmp_path / "missing.npz", tmp_path / "out.usd")
    assert (ran.code, "pip install 'marey[usd]'" in ran.err) == (2, True)


@pytest.mark.parametrize("option", ["--rig", "--body"])
def test_a_file_is_no_rig_of_the_server(marey: Command, tmp_path: Path, option: str) -> None:
    command = ("motions", "file", "0a1b2c3d", "glb", "-o", tmp_path / "out.glb", option, tmp_path / "hero.fbx")
    missing = marey(*command)
    assert (missing.code, f"{option}: is neither a file here nor" in missing.err) == (3, True)
    assert "rigs add" not in missing.err
    (tmp_path / "hero.fbx").write_bytes(b"")
    there = marey(*command)
    assert (there.code, f"{option}: is a file here" in there.err, "rigs add" in there.err) == (2, True, True)
