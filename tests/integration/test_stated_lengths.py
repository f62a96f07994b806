"""A length in the words of a prompt is that of the motion, through the command line, Python and a shipped bundle."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import marey.generate
from tests.support.command import Command

BUNDLE = "hgm3-starter"


def test_the_motion_has_the_length_of_the_words(tmp_path: Path) -> None:
    marey_command = Command({"MAREY_HOME": str(tmp_path), "MAREY_THREADS": "1"})
    prompts = (
        "a person waves for three seconds", "a person waves for two minutes", "waves, then walks for two seconds",
        "a person waves for twelve seconds",
    )  # fmt: skip
    ran = marey_command("generate", *prompts, "--bundle", BUNDLE, "--seed", 1, "-o", tmp_path / "out", "--json")
    assert ran.code == 0, ran.err
    whole, too_long, part, long = (json.loads(line) for line in ran.out.splitlines())
    assert whole["frames"] == pytest.approx(60, abs=1)
    assert too_long["frames"] <= 196
    assert part["frames"] != 40
    assert long["frames"] == pytest.approx(240, abs=1)
    for said in (
        "1 of 4 prompts, index 1 (from 0), 'a person waves for two minutes': a stated length is not used: it is out of",
        "1 of 4 prompts, index 2 (from 0), 'waves, then walks for two seconds': a stated length is that of a part",
    ):
        assert said in ran.err


def test_python_reads_the_same_words() -> None:
    model = marey.generate.load(BUNDLE, threads=1)
    stated, given = model.generate(["a person waves for three seconds", {"prompt": "she waves for 3 s", "seconds": 2}])
    assert (len(stated.joints), len(given.joints)) == (pytest.approx(60, abs=1), pytest.approx(40, abs=1))
