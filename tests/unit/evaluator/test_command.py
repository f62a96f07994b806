"""`marey train evaluator`: from a prepared folder to a bundle by the command line."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

from marey.bundles import Bundle
from marey.cli.commands.train import app
from marey.evaluator.reference import RealClips
from tests.support.prepared import write_prepared


def test_the_command_line_trains_an_evaluator_and_writes_its_bundle(tmp_path: Path) -> None:
    data, run, output = str(write_prepared(tmp_path / "prepared", 24)), str(tmp_path / "run"), tmp_path / "judge"
    chosen = ["--run", run, "--config", "tiny"]
    trained = CliRunner().invoke(
        app, ["evaluator", "tmr", data, *chosen, "--steps", "2", "--device", "cpu", "--learning-rate", "1e-3", "--json"]
    )
    assert trained.exit_code == 0, trained.output
    assert "contrast" in json.loads(trained.stdout.splitlines()[-1])
    made = CliRunner().invoke(app, ["evaluator", "bundle", data, *chosen, "-o", str(output)])
    assert made.exit_code == 0, made.output
    bundle = Bundle.open(output)
    assert made.stdout.strip() == bundle.reference
    assert bundle.manifest.parameters["train_tmr"]["learning_rate"] == 2e-3  # of `bundle`'s own configuration
    assert len(RealClips.of(bundle).split("test").clips) == 4
    again = CliRunner().invoke(app, ["evaluator", "bundle", data, *chosen, "-o", str(output)])
    assert again.exit_code != 0
