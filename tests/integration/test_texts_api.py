"""`POST /v1/texts/parse` through a real uvicorn, with the shipped labeller."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, NoReturn

import httpx2
import numpy as np
import pytest

from marey.bundles import BundleWriter, TextSpec
from marey.core.errors import Unreachable
from marey.core.settings import settings
from marey.db import create_engine, transaction
from marey.embedded import EmbeddedServer
from marey.tenants import create_key
from marey.text_service import routes
from marey.text_service.routes import ParseBody, judge_prompts, pipeline_of
from marey.vocabulary.scope import ActionLists
from tests.support.live_api import ApiThread, settings_of, with_text_service
from tests.support.models import add_text_bundles

PATH = "/v1/texts/parse"
READER = "hgm3-reader"
LISTED = "hgm3-listed"


@pytest.fixture(scope="module")
def http(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[httpx2.Client]:
    config = settings_of(tmp_path_factory.mktemp("texts"), module_database_url, valkey.url)
    with pytest.MonkeyPatch.context() as patch:
        # bundles are found by the process's own settings, the shipped labeller among them
        patch.setattr(settings(), "home", config.home)
        add_text_bundles(config.home / "models")
        for name, actions in ((READER, None), (LISTED, ActionLists(("walk", "bow", "wave")))):
            with BundleWriter(config.home / "models" / name) as writer:
                writer.add_part("masked", {"w": np.zeros(3, np.float32)})
                writer.finish(
                    name=name, version="1", kind="generator", model="hgm3", config="tiny", licence="MIT", fps=20.0,
                    parameters={"min_frames": 16, "max_frames": 196}, text=TextSpec(), actions=actions,
                )  # fmt: skip
        engine = create_engine(module_database_url)
        with transaction(engine) as conn:
            key = create_key(conn, "reader", ["read", "submit"]).secret
        with (
            with_text_service(config) as named,
            ApiThread(named) as url,
            httpx2.Client(base_url=url, timeout=60, headers={"Authorization": f"Bearer {key}"}) as client,
        ):
            pipeline_of(READER)  # as the service's process does before it is ready
            yield client
        engine.dispose()


def parse(http: httpx2.Client, *prompts: str) -> httpx2.Response:
    body = json.dumps({"prompts": prompts, "model": READER})  # as ASCII: httpx2 cannot encode a lone surrogate
    return http.post(PATH, content=body, headers={"Content-Type": "application/json"})


def test_prompts_become_graphs_in_their_order(http: httpx2.Client) -> None:
    response = parse(http, "a person walks forward", "someone kicks")
    assert response.status_code == 200, response.text
    one, two = response.json()["items"]
    assert [node["text"] for node in one["nodes"]] == ["a person walks forward", "walks", "a person", "forward"]
    assert {"from": 1, "to": 3, "type": "ARGM-DIR", "role": "ARGM-DIR"} in one["edges"]
    assert two["text"] == "someone kicks"


@pytest.mark.parametrize("prompt", ["", "\x00", "\ud800", "🕺", "walk " * 10_000, "一个人向前走"])
def test_a_bad_prompt_is_named(http: httpx2.Client, prompt: str) -> None:
    response = parse(http, "a person walks", prompt)
    assert response.status_code == 422
    problem = response.json()
    assert problem["type"].endswith("invalid-input")
    assert "prompts.1" in response.text


@pytest.mark.parametrize("model", ["../../secret", "/etc", "a b", ""])
def test_a_path_is_no_model(http: httpx2.Client, model: str) -> None:
    assert http.post(PATH, json={"prompts": ["a person walks"], "model": model}).status_code == 422


def test_an_unknown_model_is_not_found(http: httpx2.Client) -> None:
    assert http.post(PATH, json={"prompts": ["a person walks"], "model": "nobody"}).status_code == 404


def test_too_many_prompts_are_refused(http: httpx2.Client) -> None:
    assert parse(http, *["a person walks"] * 65).status_code == 422


def test_a_key_is_needed(http: httpx2.Client) -> None:
    assert httpx2.post(f"{http.base_url}{PATH}", json={"prompts": ["a person walks"]}).status_code == 401


def dry_run(http: httpx2.Client, *prompts: str, model: str = LISTED) -> dict[str, Any]:
    rows = [{"prompt": prompt, "model": model} for prompt in prompts]
    answer = http.post("/v1/jobs", params={"validate_only": True}, json={"items": rows})
    assert answer.status_code == 200, answer.text
    return answer.json()["scope_report"]


def test_a_dry_run_asks_the_encoder_about_what_the_words_leave_undecided(http: httpx2.Client) -> None:
    judge_prompts(ParseBody(prompts=["she scoots off"], model=LISTED))  # vectors of all phrases, once
    report = dry_run(http, "a person walks", "a wave of nausea", "a low bow")
    assert (report["by"], report["known"], report["unknown"]) == ("encoder", 2, 1)
    assert [example["prompt"] for example in report["examples"]] == ["a wave of nausea"]
    assert dry_run(http, "a person walks")["by"] == "words"


def test_a_dry_run_of_what_cannot_be_judged_is_by_words(http: httpx2.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    assert dry_run(http, "a wave of nausea", model=READER)["unlisted"] == 1

    def broken(_: ParseBody) -> NoReturn:
        raise Unreachable("gone")

    monkeypatch.setattr(routes, "judge_prompts", broken)
    report = dry_run(http, "a wave of nausea")
    assert (report["by"], report["known"]) == ("words", 1)
