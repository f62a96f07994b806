"""`marey train MODEL …` with configuration files, on every model that is trained here."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from marey.cli.commands.train import app
from marey.core.errors import InvalidFile
from marey.registry import resolve, trainings
from marey.training.config_file import open_config


@pytest.mark.parametrize("model", trainings())
def test_a_printed_configuration_is_the_preset_it_was_made_from(model: str, tmp_path: Path) -> None:
    printed = CliRunner().invoke(app, [model, "config", "--config", "paper"])
    assert printed.exit_code == 0, printed.output
    file = tmp_path / "paper.toml"
    file.write_text(printed.output, encoding="utf-8")
    named = resolve(trainings()[model].config)
    assert open_config(named, str(file)) == named("paper")
    again = CliRunner().invoke(app, [model, "config", "--config", str(file)])
    assert again.output == printed.output


@pytest.mark.parametrize("model", trainings())
def test_every_command_reads_the_file(model: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('preset = "tiny"\nfsp = 20\n', encoding="utf-8")
    chosen = [str(tmp_path), "--run", str(tmp_path), "--config", str(file)]
    stage = trainings()[model].stages[0].name
    for words in ([stage, *chosen, "--steps", "1"], ["bundle", *chosen, "-o", str(tmp_path / "made")]):
        done = CliRunner().invoke(app, [model, *words])
        assert isinstance(done.exception, InvalidFile)
        assert str(done.exception) == f"{file}: fsp: is an unknown field\n  Did you mean fps?"
