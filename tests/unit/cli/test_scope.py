"""`marey generate --scope refuse`: refused before a model is loaded."""

from __future__ import annotations

from pathlib import Path

from tests.support.command import Command


def test_generate_counts_arguments_where_there_is_no_file(tmp_path: Path) -> None:
    marey = Command({"MAREY_HOME": str(tmp_path)})
    given = ("generate", "a person walks", "asdf qwer zxcv", "--bundle", "hgm3-starter", "--scope", "refuse")
    ran = marey(*given, "-o", tmp_path / "out")
    assert (ran.code, ran.out) == (2, "")
    assert "argument 2: prompt: names an action that the model does not know" in ran.err


def test_generate_refuses_unknown_prompts_by_line_with_what_the_model_knows(tmp_path: Path) -> None:
    file = tmp_path / "prompts.txt"
    file.write_text("a person walks\n\nasdf qwer zxcv\n")
    marey = Command({"MAREY_HOME": str(tmp_path)})
    ran = marey("generate", "-f", file, "--bundle", "hgm3-starter", "--scope", "refuse", "-o", tmp_path / "out")
    assert (ran.code, ran.out) == (2, "")
    assert "line 3: prompt: names an action that the model does not know: 'asdf qwer zxcv' (gibberish)" in ran.err
    assert "hgm3-starter knows: walk, walk backward, run, turn, wave, raise arm, bow." in ran.err
    assert not (tmp_path / "out").exists()
