"""The scope of prompts: warnings, refusals, and what is stored, of a real server and through its clients."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx2
import pytest

from marey.api.text_client import TextService
from marey.client import Client, OutOfScope
from marey.db import transaction
from marey.takes import erase
from marey.tenants import DEFAULT_TENANT
from marey.vocabulary.scope import ActionLists, NamedAction, Scope
from tests.integration.takes.test_edits import post
from tests.support.command import Command
from tests.support.editing import stored
from tests.support.live_api import BUNDLE, QUALITY, LiveApi, write_bundle

UNLISTED = "hgm3-unlisted"
NONSENSE = "asdf qwer zxcv"
KNOWN = f"{BUNDLE} knows: walk, run."
NDJSON = {"Content-Type": "application/x-ndjson"}


@pytest.fixture(scope="module")
def api_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("api")
    write_bundle(home / "models", actions=ActionLists(("walk", "run"), tried=("kick",)))
    write_bundle(home / "models", UNLISTED)
    return home


@pytest.fixture
def marey(api: LiveApi) -> Command:
    return Command({"MAREY_SERVER": api.url, "MAREY_KEY": api.key})


def submit(http: httpx2.Client, *prompts: str, **fields: object) -> dict[str, Any]:
    answer = http.post("/v1/jobs", json={"items": [{"prompt": prompt} for prompt in prompts], **fields})
    assert answer.status_code == 202, answer.text
    return answer.json()


def items(http: httpx2.Client, job: dict[str, Any]) -> list[dict[str, Any]]:
    return http.get(f"/v1/jobs/{job['id']}/items").json()["items"]


def test_a_submit_warns_of_what_the_model_does_not_know_and_stores_each_scope(http: httpx2.Client) -> None:
    job = submit(http, "a person walks", "she sprints", "he kicks, then kicks again", NONSENSE)
    assert job["scope"] == "warn"
    assert {name: job["scope_report"][name] for name in ("known", "close", "tried", "unknown", "unlisted")} == {
        "known": 1, "close": 1, "tried": 1, "unknown": 1, "unlisted": 0,
    }  # fmt: skip
    assert job["scope_report"]["actions"] == {BUNDLE: ["walk", "run"]}
    assert job["warnings"][0].endswith(KNOWN)
    assert f"index 3 (from 0), {NONSENSE!r}" in job["warnings"][0]
    scopes = [item["scope"] for item in items(http, job)]
    assert [scope["verdict"] for scope in scopes] == ["known", "close", "tried", "unknown"]
    assert {scope["by"] for scope in scopes} == {"words"}
    assert scopes[1]["actions"] == [{"text": "sprints", "verdict": "close", "action": "sprint", "read_as": "run"}]
    assert scopes[2]["flags"] == ["counts"]
    assert http.get(f"/v1/jobs/{job['id']}").json()["scope"] == "warn"


def test_refused_prompts_are_told_by_line_with_what_is_known_and_nothing_is_written(http: httpx2.Client) -> None:
    before = http.get("/v1/jobs").json()["items"]
    lines = f'{{"prompt": "a person walks"}}\n\n{{"prompt": "{NONSENSE}"}}\n{{"prompt": "he kicks"}}\n'
    answer = http.post("/v1/jobs", content=lines.encode(), headers=NDJSON, params={"scope": "refuse"})
    problem = answer.json()
    assert (answer.status_code, problem["type"]) == (422, "urn:marey:problem:out-of-scope")
    assert [each["line"] for each in problem["problems"]] == [3]
    assert KNOWN in problem["hint"]
    assert http.get("/v1/jobs").json()["items"] == before
    job = submit(http, "a person walks", "he kicks", scope="refuse")
    assert job["scope"] == "refuse"


def test_other_problems_are_told_before_the_scope(http: httpx2.Client) -> None:
    body = {"items": [{"prompt": NONSENSE, "seconds": 40}], "scope": "refuse"}
    assert http.post("/v1/jobs", json=body).json()["type"] == "urn:marey:problem:invalid-items"


def test_ignored_scopes_are_not_examined(http: httpx2.Client) -> None:
    job = submit(http, NONSENSE, scope="ignore")
    assert (job["scope"], job["scope_report"], job["warnings"]) == ("ignore", None, [])
    assert [item["scope"] for item in items(http, job)] == [None]
    assert http.post("/v1/jobs", json={"items": [{"prompt": "walk"}], "scope": "maybe"}).status_code == 422


def test_a_bundle_without_lists_accepts_everything_and_cannot_refuse(http: httpx2.Client) -> None:
    body = {"items": [{"prompt": NONSENSE, "model": UNLISTED}]}
    job = http.post("/v1/jobs", json=body).json()
    assert (job["scope_report"]["unlisted"], job["warnings"]) == (1, [])
    assert [item["scope"] for item in items(http, job)] == [None]
    refused = http.post("/v1/jobs", json={**body, "scope": "refuse"})
    assert (refused.status_code, refused.json()["where"]) == (422, "scope")


def test_a_repeated_submit_is_answered_with_the_same_report(http: httpx2.Client) -> None:
    body = {"items": [{"prompt": NONSENSE}, {"prompt": "a person runs"}]}
    first, again = (http.post("/v1/jobs", json=body, headers={"Idempotency-Key": "scope"}) for _ in range(2))
    assert again.headers["Idempotency-Replayed"] == "true"
    assert again.json()["id"] == first.json()["id"]
    assert again.json()["scope_report"] == first.json()["scope_report"]
    assert again.json()["warnings"] == first.json()["warnings"]


def test_a_re_roll_has_the_scope_of_its_prompt(api: LiveApi, http: httpx2.Client) -> None:
    job = submit(http, "she sprints")
    api.work()
    (item,) = items(http, job)
    answer = http.post("/v1/motions/reroll", json={"motions": [item["motion"]["id"]]})
    assert answer.is_success, answer.text
    first, again = items(http, job)
    assert again["scope"] == first["scope"]
    api.work()


def test_an_erased_prompt_leaves_no_words_in_its_scope(api: LiveApi, http: httpx2.Client) -> None:
    job = submit(http, "zanzibar foo barbaz")
    assert items(http, job)[0]["scope"]["actions"][0]["text"] == "zanzibar foo barbaz"
    http.post(f"/v1/jobs/{job['id']}/cancel")
    with transaction(api.engine) as conn:
        erase(conn, DEFAULT_TENANT, job["id"], by="test")
    assert items(http, job)[0]["scope"] is None


def test_the_prompts_of_an_edit_have_their_scope(api: LiveApi, http: httpx2.Client) -> None:
    motion = stored(api, "a person walks")["id"]
    ops = [{"op": "extend", "seconds": 1, "prompt": "she sprints"}, {"op": "extend", "seconds": 1, "prompt": NONSENSE}]
    made = post(http, motion, *ops)
    assert made.status_code == 202, made.text
    assert made.json()["warnings"][0].endswith(KNOWN)
    (item,) = items(http, made.json())
    assert (made.json()["scope"], item["scope"]["verdict"], item["scope"]["by"]) == ("warn", "unknown", "words")
    assert [action["verdict"] for action in item["scope"]["actions"]] == ["close", "unknown"]
    known = post(http, motion, ops[0], scope="refuse").json()
    assert (known["scope"], items(http, known)[0]["scope"]["verdict"]) == ("refuse", "close")
    refused = post(http, motion, *ops, scope="refuse").json()
    assert (refused["type"], len(refused["problems"])) == ("urn:marey:problem:out-of-scope", 1)
    assert items(http, post(http, motion, *ops, scope="ignore").json())[0]["scope"] is None
    moved = post(http, motion, {"op": "mirror"}).json()
    assert (moved["scope"], items(http, moved)[0]["scope"]) == ("ignore", None)


def test_a_checked_edit_has_the_encoder_s_verdict_where_words_leave_it(
    api: LiveApi, http: httpx2.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    async def scopes(_: TextService, prompts: dict[str, list[str]]) -> dict[tuple[str, str], Scope]:
        asked.append(prompts)
        return {(BUNDLE, "a run on a bank"): Scope((NamedAction("a run on a bank", "unknown"),), by="encoder")}

    monkeypatch.setattr(TextService, "scopes", scopes)
    motion = stored(api, "a person walks")["id"]
    op = {"op": "extend", "seconds": 1, "prompt": "a run on a bank"}
    answer = http.post(f"/v1/motions/{motion}/edits", params={"validate_only": True}, json={"ops": [op]}).json()
    assert asked == [{BUNDLE: ["a run on a bank"]}]
    assert (answer["scope_report"]["by"], answer["scope_report"]["unknown"]) == ("encoder", 1)


def test_the_command_line_warns_on_stderr_and_dry_runs_by_words_only(marey: Command) -> None:
    ran = marey("submit", NONSENSE, "--json")
    assert ran.code == 0
    assert f"Warning: {NONSENSE!r}: no action that the model knows; the motion is arbitrary. {KNOWN}" in ran.err
    assert json.loads(ran.out)["warnings"]
    dry = marey("submit", NONSENSE, "a person walks", "--dry-run")
    assert "Prompts by words only: 1 known, 0 close, 0 tried, 1 unknown." in dry.err
    assert KNOWN in dry.err
    assert "by words" not in marey("submit", NONSENSE, "--dry-run", "--scope", "ignore").err


def test_the_command_line_refuses_with_the_line_of_the_file(marey: Command, tmp_path: Path) -> None:
    file = tmp_path / "prompts.txt"
    file.write_text(f"a person walks\n\n{NONSENSE}\n")
    ran = marey("submit", "-f", file, "--scope", "refuse")
    assert (ran.code, ran.out) == (2, "")
    assert f"line 3: prompt: names an action that the model does not know: {NONSENSE!r}" in ran.err
    assert KNOWN in ran.err


def test_the_python_client_has_warnings_and_raises_out_of_scope(api: LiveApi) -> None:
    with Client(api.url, key=api.key) as client:
        job = client.jobs.submit([NONSENSE])
        assert KNOWN in job.warnings[0]
        assert job.scope_report is not None
        assert job.scope_report.unknown == 1
        (item,) = client.jobs.items(job)
        assert item.scope is not None
        assert item.scope.verdict == "unknown"
        with pytest.raises(OutOfScope, match="does not know") as raised:
            client.jobs.submit(["a person walks", NONSENSE], scope="refuse")
        assert [problem.line for problem in raised.value.problems] == [2]
        assert client.jobs.submit([NONSENSE], scope="ignore").warnings == ()


def test_the_quality_of_a_job_is_counted_by_flag(api: LiveApi, http: httpx2.Client, marey: Command) -> None:
    job = submit(http, "a person walks", "a person runs")
    assert http.get(f"/v1/jobs/{job['id']}/quality").json() == {"measured": 0, "ok": 0, "flags": {}}
    api.work()
    flags = {str(flag): 2 for flag in QUALITY.flags}
    counts = {"measured": 2, "ok": 2 * QUALITY.ok, "flags": flags}
    assert http.get(f"/v1/jobs/{job['id']}/quality").json() == counts
    listed = ", ".join(f"{count} {flag}" for flag, count in sorted(flags.items()))
    line = f"{counts['ok']} of 2 ok{': ' if flags else ''}{listed}"
    assert line in marey("jobs", "show", job["id"]).out
