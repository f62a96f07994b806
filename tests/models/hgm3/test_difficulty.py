"""`marey render --difficulty`: what the loss predictor's teacher says of a motion's tokens."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from marey.bundles import Bundle
from marey.cli.main import app
from marey.data.prepared import PreparedData
from marey.models.hgm3.bundle import load_networks, random_bundle
from marey.models.hgm3.conditions import graph_batch
from marey.models.hgm3.difficulty import predict_difficulty, token_difficulties
from tests.support.prepared import text_features


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return random_bundle(tmp_path_factory.mktemp("difficulty") / "random-tiny")


def test_difficulty_is_the_teachers_under_the_whole_graph(bundle: Bundle) -> None:
    config, networks = load_networks(bundle)
    tokens = torch.randint(config.tokenizer.codes, (1, 20), generator=torch.Generator().manual_seed(0))
    text = text_features(0)
    bare = replace(text, nodes=np.concatenate([text.nodes[:3], -text.nodes[3:]]))
    found = [
        predict_difficulty(networks, tokens, graph_batch([each], config.condition, torch.device("cpu")))
        for each in (text, text, bare)
    ]
    assert found[0].shape == (1, 20)
    assert torch.equal(found[0], found[1])
    assert not torch.allclose(found[0], found[2]), "specific nodes count"
    nodes = networks.masked.text(graph := graph_batch([text], config.condition, torch.device("cpu")))
    valid = torch.ones(1, 20, dtype=torch.bool)
    expected = networks.predictor(tokens, valid, networks.predictor.condition(nodes), graph.present)
    torch.testing.assert_close(found[0], expected)


def test_each_token_of_a_prepared_clip_has_a_difficulty(bundle: Bundle, prepared: PreparedData) -> None:
    motion = np.array(prepared.features(prepared.clips[0]))
    found, other = token_difficulties(bundle, [motion, motion], ["a person walks", "a person jumps"])
    assert found.values.shape == (min(len(motion), 196) // 4,)
    assert (found.values.min(), found.values.max()) == (0, 1)
    assert found.seconds == 0.2
    assert not np.allclose(found.values, other.values)


def test_the_command_draws_prepared_clips_and_refuses_what_it_cannot_judge(
    bundle: Bundle, prepared: PreparedData, tmp_path: Path
) -> None:
    def render(*words: object) -> tuple[int, str]:
        done = CliRunner().invoke(app, ["render", *map(str, words)])
        return done.exit_code, done.output

    drawn = [prepared.path, "--clip", 0, "--difficulty", bundle.path]
    for name in ("a.png", "a.html"):
        assert render(*drawn, "-o", tmp_path / name)[0] == 0
        assert (tmp_path / name).stat().st_size > 1000
    assert "<title>token 0, 0.00 s: " in (tmp_path / "a.html").read_text(encoding="utf-8")
    number = len(prepared.clips)
    for words, said in (
        ([prepared.path, "-o", tmp_path / "b.png"], "Name clips of a prepared folder by --clip NUMBER"),
        ([prepared.path, "--clip", number, "-o", tmp_path / "b.png"], f"there is no clip {number}"),
    ):
        code, output = render(*words)
        assert code == 2
        assert said in output
    assert render(prepared.path, "--clip", 0, "-o", tmp_path / "walk.npz")[0] == 2
