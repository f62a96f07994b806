"""`marey generate --best-of`, through the command line and the shipped bundle."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.generation.candidates import candidate_seed
from marey.motion.clip import load_npz
from tests.support.command import Command

PROMPT = ("generate", "a person waves with the left hand", "--seconds", "2", "--bundle", "hgm3-starter", "--json")


@pytest.fixture(scope="module")
def marey(tmp_path_factory: pytest.TempPathFactory) -> Command:
    return Command({"MAREY_HOME": str(tmp_path_factory.mktemp("home")), "MAREY_THREADS": "1"})


@pytest.fixture(scope="module")
def plain(marey: Command, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Answer to a plain motion: no option chooses anything."""
    return line_of(marey, tmp_path_factory.mktemp("plain"), "--seed", 3)


def line_of(marey: Command, folder: Path, *options: object) -> dict[str, Any]:
    ran = marey(*PROMPT, "-o", folder, *options)
    assert ran.code == 0, ran.err
    return json.loads(ran.out)


def test_the_best_of_several_candidates_is_written(marey: Command, tmp_path: Path, plain: dict[str, Any]) -> None:
    one = line_of(marey, tmp_path / "one", "--seed", 3, "--best-of", 1)
    assert plain["motion"] == one["motion"]
    assert plain["selection"] is None

    best = line_of(marey, tmp_path / "best", "--seed", 3, "--best-of", 3)
    found = best["selection"]
    assert best["seed"] == 3
    assert [each["seed"] for each in found["candidates"]] == [candidate_seed(3, n) for n in range(3)]
    assert found["candidates"][0]["match"] == plain["quality"]["match"]["value"]
    ranks = [(each["ok"], each["match"], -each["index"]) for each in found["candidates"]]
    assert found["chosen"] == ranks.index(max(ranks))
    clip = load_npz(Path(best["files"]["npz"]))
    assert clip.manifest["selection"] == found

    alone = line_of(marey, tmp_path / "alone", "--seed", found["candidates"][found["chosen"]]["seed"])
    np.testing.assert_allclose(clip.joints, load_npz(Path(alone["files"]["npz"])).joints, atol=1e-4)


def test_numbers_out_of_range_are_refused(marey: Command, tmp_path: Path) -> None:
    for option, number in (("--best-of", 9), ("--best-of", 0), ("--redraws", 3)):
        ran = marey(*PROMPT, "-o", tmp_path / "out", option, number)
        assert ran.code == 2
        assert "is outside" in ran.err
    assert not (tmp_path / "out").exists()


def test_variety_changes_the_settings_and_normal_changes_nothing(
    marey: Command, tmp_path: Path, plain: dict[str, Any]
) -> None:
    normal, high = (line_of(marey, tmp_path / level, "--seed", 3, "--variety", level) for level in ("normal", "high"))
    assert plain["motion"] == normal["motion"] != high["motion"]
    settings = [load_npz(Path(line["files"]["npz"])).manifest["settings"] for line in (plain, high)]
    assert settings[1]["temperature"] == pytest.approx(1.6 * settings[0]["temperature"])
    assert marey(*PROMPT, "-o", tmp_path / "out", "--variety", "huge").code == 2
