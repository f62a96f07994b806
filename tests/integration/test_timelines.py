"""Timelines of prompts through the API, the command line and the client; motions are made up."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import httpx2
import pytest

from marey.client import Client
from marey.vocabulary.scope import ActionLists
from tests.support.command import Command
from tests.support.live_api import BUNDLE, LiveApi, write_bundle
from tests.support.models import NOT_KEEPING

ROWS = [{"start": 0, "end": 3, "prompt": "a person walks"}, {"start": 4, "end": 20, "prompt": "a person runs"}]
TEXT = "0-3 a person walks; 4-20 a person runs"
BAD = "0-3 a person walks; 3-5 asdf qwer zxcv"
OTHER = "other-listed"


@pytest.fixture(scope="module")
def api_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("api")
    write_bundle(home / "models", actions=ActionLists(("walk", "run"), tried=("kick",)))
    write_bundle(home / "models", OTHER, model=NOT_KEEPING)
    return home


@pytest.fixture
def marey(api: LiveApi) -> Command:
    return Command({"MAREY_SERVER": api.url, "MAREY_KEY": api.key})


def submit(http: httpx2.Client, *items: dict[str, object], **query: str) -> httpx2.Response:
    return http.post("/v1/jobs", json={"items": list(items), **query})


def items_of(http: httpx2.Client, job: dict[str, Any]) -> list[dict[str, Any]]:
    return http.get(f"/v1/jobs/{job['id']}/items").json()["items"]


@pytest.mark.parametrize("timeline", [ROWS, TEXT, TEXT.replace("-", " – ")])
def test_rows_and_text_are_the_same_timeline(http: httpx2.Client, timeline: object) -> None:
    answer = submit(http, {"timeline": timeline, "seed": 3, "variants": 2, "seconds": 20}, {"prompt": "a person walks"})
    assert answer.status_code == 202, answer.text
    first, second, plain = items_of(http, answer.json())
    assert (first["prompt"], first["timeline"], first["seconds"]) == (TEXT, ROWS, 20)
    assert (second["timeline"], second["seed"]) == (ROWS, 4)
    assert (plain["prompt"], plain["timeline"]) == ("a person walks", None)


def test_problems_name_line_field_and_row(http: httpx2.Client) -> None:
    answer = submit(
        http,
        {"timeline": "0-3 a person walks; 2-5 a person runs"},
        {"timeline": TEXT, "prompt": "a person walks"},
        {"timeline": TEXT, "seconds": 5},
        {"timeline": TEXT, "model": OTHER},
        {"seed": 3},
    )
    problem = answer.json()
    assert (answer.status_code, problem["type"]) == (422, "urn:marey:problem:invalid-items")
    assert [(each["line"], each["field"], each["message"]) for each in problem["problems"]] == [
        (1, "timeline", "row 1 (0-3) overlaps row 2 (2-5)"),
        (2, "prompt", "stands beside a timeline: give one of the two"),
        (3, "seconds", "5 is not the end of the timeline, 20: leave it out"),
        (
            4,
            "timeline",
            f"the model {NOT_KEEPING!r} cannot generate timelines: it makes no motion between other frames. Choose a "
            "bundle of the default model, or submit each row as a prompt.",
        ),
        (5, "prompt", "is missing: say what the person does"),
    ]


def test_an_action_that_is_not_known_is_told_with_its_row(http: httpx2.Client) -> None:
    job = submit(http, {"timeline": BAD}).json()
    assert job["scope_report"]["unknown"] == 1
    assert job["warnings"][0].startswith("'row 2 (3-5): asdf qwer zxcv': no action that the model knows")
    assert items_of(http, job)[0]["scope"]["verdict"] == "unknown"
    checked = http.post("/v1/jobs", json={"items": [{"timeline": BAD}]}, params={"validate_only": True})
    assert checked.is_success, checked.text
    assert checked.json()["scope_report"]["unknown"] == 1
    refused = submit(http, {"timeline": TEXT}, {"timeline": BAD}, scope="refuse")
    (problem,) = refused.json()["problems"]
    assert (refused.status_code, problem["line"], problem["field"]) == (422, 2, "timeline")
    assert problem["message"].startswith("row 2 (3-5) names an action that the model does not know: 'asdf qwer zxcv'")


def test_a_re_roll_has_the_timeline_and_the_next_seed(api: LiveApi, http: httpx2.Client) -> None:
    job = submit(http, {"timeline": ROWS, "seed": 3}).json()
    api.work()
    (item,) = items_of(http, job)
    answer = http.post("/v1/motions/reroll", json={"motions": [item["motion"]["id"]]})
    assert answer.is_success, answer.text
    first, again = items_of(http, job)
    assert (again["timeline"], again["seed"], again["prompt"]) == (first["timeline"], 4, TEXT)
    api.work()


def test_the_command_line_submits_fetches_and_submits_again(api: LiveApi, marey: Command, tmp_path: Path) -> None:
    ran = marey("submit", "--timeline", TEXT, "--seed", 3, "--json").ok()
    assert f"{TEXT!r} has no prompt at 3-4 s: the model fills it without one." in ran.err
    job = json.loads(ran.out)["id"]
    api.work()
    assert TEXT in marey("motions", "list", "--job", job).ok().out
    marey("fetch", job, "-o", tmp_path / "clips").ok()
    assert (tmp_path / "clips" / "00000_0-3-a-person-walks-4-20-a-person-runs_3.bvh").is_file()
    manifest = tmp_path / "clips" / "manifest.csv"
    with manifest.open(newline="", encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert (row["timeline"], row["seconds"]) == (TEXT, "20.0")
    again = json.loads(marey("submit", "-f", manifest, "--json").ok().out)
    with Client(api.url, key=api.key) as client:
        (item,) = client.jobs.items(again["id"])
    assert item.timeline == tuple(ROWS)
    assert (item.prompt, item.seed) == (TEXT, 3)
    api.work()
    marey("fetch", again["id"], "-o", tmp_path / "clips").ok()  # the manifest holds both jobs


def test_the_command_line_takes_one_kind_of_input(marey: Command) -> None:
    marey("submit", "a person walks", "--timeline", TEXT).refused(2, "both PROMPT and --timeline are given")
    marey("submit", "--timeline", TEXT, "--seconds", 5).refused(2, "seconds: 5 is not the end of the timeline, 20")
    marey("submit", "--timeline", "0-3 walk; wave").refused(2, "argument 1: timeline: row 2, 'wave', has no times")
    dry = marey("submit", "--timeline", TEXT, "--timeline", TEXT, "--dry-run").ok()
    assert f"2 motions would be made, with {BUNDLE}" in dry.err


def test_the_python_client_submits_rows_and_texts(api: LiveApi) -> None:
    with Client(api.url, key=api.key) as client:
        job = client.jobs.submit([{"timeline": ROWS}, {"timeline": TEXT, "name": "both"}], seconds=4.0)
        first, second = client.jobs.items(job)
    assert first.timeline == second.timeline == tuple(ROWS)
    assert (first.prompt, first.seconds, second.name) == (TEXT, 20.0, "both")
