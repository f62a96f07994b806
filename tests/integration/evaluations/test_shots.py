"""Evaluations of timelines and constraints: from the request to what the evaluator is given."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from marey import registry
from marey.bundles import limits
from marey.embedded import EmbeddedServer
from tests.support import toy
from tests.support.evaluations import GENERATOR
from tests.support.live_evaluations import Studio, studio

TIMELINE = "0-3 walk ahead; 3-5 walk on"
PATH = [{"type": "root_path", "times": [0, 3], "positions_xz": [[0, 0], [0, 3]]}]
PROMPTS = [{"timeline": TIMELINE}, {"prompt": "walk", "constraints": PATH}, {"prompt": "walk away", "expected": "walk"}]


@pytest.fixture
def server(tmp_path: Path, database_url: str, valkey: EmbeddedServer) -> Iterator[Studio]:
    with studio(tmp_path, database_url, valkey.url) as made:
        yield made


@pytest.fixture
def http(server: Studio) -> Iterator[httpx2.Client]:
    with server.api.http() as client:
        yield client


@pytest.fixture
def keeps_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """The toy's model generates frames between others."""
    spec = dataclasses.replace(registry.get_model("hgm3"), name=toy.QUEUE, settings=(), variety=None)
    assert spec.keeps_frames
    monkeypatch.setattr(limits, "find_model", lambda name: spec if name == toy.QUEUE else registry.find_model(name))


def ask(http: httpx2.Client, prompts: list[dict[str, object]]) -> httpx2.Response:
    return http.post("/v1/evaluations", json={"bundle": GENERATOR, "prompts": prompts, "source": "shots"})


@pytest.mark.usefixtures("keeps_frames")
def test_timelines_and_constraints_reach_the_generator_and_the_evaluator(server: Studio, http: httpx2.Client) -> None:
    made = ask(http, PROMPTS)
    assert made.status_code == 202, made.text
    server.work()
    found = http.get(f"/v1/evaluations/{made.json()['id']}").json()
    assert (found["state"], found["prompts"]) == ("done", 3)
    items = http.get(f"/v1/jobs/{found['generation']['id']}/items").json()["items"]
    assert (items[0]["prompt"], items[0]["seconds"], len(items[0]["timeline"])) == (TIMELINE, 5, 2)
    assert [item["constraints"] is not None for item in items] == [False, True, False]
    assert items[1]["timeline"] is None
    (seen,) = server.judge.seen
    assert [(each.prompt, each.expected, each.constrained) for each in seen.items] == [
        (TIMELINE, None, False),
        ("walk", None, True),
        ("walk away", "walk", False),
    ]


def test_a_model_without_timelines_refuses_them_before_anything_is_made(server: Studio, http: httpx2.Client) -> None:
    refused = ask(http, PROMPTS)
    (problem,) = refused.json()["problems"]
    assert (refused.status_code, problem["line"], problem["field"]) == (422, 1, "timeline")
    assert "cannot generate timelines" in problem["message"]
    assert http.get("/v1/evaluations").json()["items"] == []


def test_poses_of_motions_are_refused_with_their_field(http: httpx2.Client) -> None:
    pose = [{"type": "pose_keyframe", "frame": 3, "motion": {"id": "0" * 32, "frame": 0}}]
    refused = ask(http, [{"prompt": "walk", "constraints": pose}, {"prompt": "walk on"}])
    (problem,) = refused.json()["problems"]
    assert (refused.status_code, problem["field"]) == (422, "constraints.0.motion")
