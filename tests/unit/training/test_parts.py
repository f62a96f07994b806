"""Trained parts: the mean of several."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from typer.testing import CliRunner

from marey.cli.commands.train import app
from marey.core.errors import InvalidInput, NotFound
from marey.data.licences import Terms
from marey.training.parts import TrainedPart, load_part, mean_part, save_part

CMU = Terms("cmu", "CMU", "free", "CMU", "https://mocap.cs.cmu.edu", "commercial")
G1 = Terms("g1_moves", "G1 Moves", "CC-BY-4.0", "G1", "https://example.org", "commercial")


def part(value: float, count: int = 0, *, seed: int = 0, source: Terms = CMU) -> TrainedPart:
    state = {"weight": torch.full((2, 3), value), "steps": torch.tensor(count)}
    return TrainedPart(state, {"seed": seed}, {"loss": value}, "data", {"steps": count, "seed": seed}, (source,))


def test_a_mean_has_the_weights_between_and_the_sources_of_all() -> None:
    found = mean_part({"a": part(1.0, 10), "b": part(2.0, 20, seed=1, source=G1), "c": part(6.0, 30, seed=2)})
    assert torch.equal(found.state["weight"], torch.full((2, 3), 3.0))
    assert found.state["steps"] == 30
    assert found.config == {"seed": 2}
    assert found.metrics == {}
    assert [each["seed"] for each in found.budget["mean_of"]] == [0, 1, 2]
    assert found.sources == (CMU, G1)


def test_only_trainings_of_one_network_on_the_same_data_have_a_mean() -> None:
    one = part(1.0)
    other = replace(one, state={**one.state, "weight": torch.zeros(3, 2)})
    for parts, message in (
        ({"a": one}, "a: is the only training"),
        ({"a": one, "b": other}, "b: holds another network than the first"),
        ({"a": one, "b": replace(one, data_sha256="others")}, "b: was trained on other data than the first"),
    ):
        with pytest.raises(InvalidInput, match=message):
            mean_part(parts)


def test_the_command_writes_the_mean_into_a_run(tmp_path: Path) -> None:
    for name, value in (("a", 1.0), ("b", 2.0)):
        save_part(tmp_path / name / "masked" / "part", part(value))
    runs = [str(tmp_path / name) for name in ("a", "b")]
    done = CliRunner().invoke(app, ["mean", "masked", *runs, "--run", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output
    assert torch.equal(load_part(tmp_path / "run" / "masked" / "part").state["weight"], torch.full((2, 3), 1.5))
    missing = CliRunner().invoke(app, ["mean", "residual", *runs, "--run", str(tmp_path / "run")])
    assert isinstance(missing.exception, NotFound)
    assert "this stage has not finished" in str(missing.exception)
    assert not (tmp_path / "run" / "residual").exists()
