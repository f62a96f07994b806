"""A body with an unknown field: the problem names it, and the fields that exist."""

from __future__ import annotations

import pytest
from fastapi import FastAPI
from pydantic import ValidationError
from starlette.testclient import TestClient

from marey.api.edits.schemas import NewEditBody
from marey.api.evaluations.schemas import NewEvaluationBody
from marey.api.jobs.schemas import JobPatch, NewJobBody
from marey.api.jobs.service import job_fields, read_fields
from marey.api.schedules.schemas import ScheduleFields, SchedulePatch
from marey.http import problems
from marey.items.problems import InvalidItems

PATCH_FIELDS = "is not a known field (did you mean 'priority'?); known: priority, comment, fail_early"


@pytest.fixture
def client() -> TestClient:
    app = FastAPI()
    problems.install(app)

    @app.patch("/job")
    def _job(body: JobPatch) -> None: ...

    @app.post("/words")
    def _words(body: dict[str, JobPatch]) -> None: ...

    return TestClient(app)


def test_of_a_body_that_the_route_declares(client: TestClient) -> None:
    problem = client.patch("/job", json={"priorty": 3}).json()
    assert (problem["where"], problem["detail"]) == ("priorty", PATCH_FIELDS)
    problem = client.patch("/job", json={"priorty": 3, "priority": "high"}).json()
    assert {each["field"] for each in problem["problems"]} == {"priorty", "priority"}
    assert f"priorty: {PATCH_FIELDS}" in problem["detail"]
    problem = client.post("/words", json={"a": {"priorty": 3}}).json()
    assert (problem["where"], problem["detail"]) == ("a.priorty", PATCH_FIELDS)


def test_of_a_body_that_the_route_parses_itself() -> None:
    with pytest.raises(InvalidItems) as caught:
        job_fields({"priorty": 3}, NewJobBody)
    assert [(each.field, each.message) for each in caught.value.problems] == [
        ("priorty", f"is not a known field (did you mean 'priority'?); known: {', '.join(NewJobBody.model_fields)}")
    ]
    assert "items" in NewJobBody.model_fields
    with pytest.raises(InvalidItems, match="paused, request"):
        read_fields(ScheduleFields, {"pause": True}, SchedulePatch)
    with pytest.raises(InvalidItems, match="prompts, name, comment"):
        read_fields(NewEvaluationBody, {"prompt": "a person walks", "bundle": "hgm3"})


@pytest.mark.parametrize("value", [True, "3", "3.0"])
def test_a_text_and_true_are_no_numbers_in_json_and_a_text_is_one_in_a_query(client: TestClient, value: object) -> None:
    for field in ("priority", "fail_early"):
        problem = client.patch("/job", json={field: value}).json()
        assert (problem["where"], "not a" in problem["detail"]) == (field, True)
    for model, field, whole in ((NewEvaluationBody, "seed", None), (NewEvaluationBody, "repeats", None)):
        with pytest.raises(InvalidItems, match="whole number"):
            read_fields(model, {"bundle": "hgm3", field: value}, whole)
    with pytest.raises(InvalidItems, match="whole number"):
        job_fields({"keep_days": value}, NewJobBody)
    with pytest.raises(ValidationError, match="keep_days"):
        NewEditBody.model_validate({"ops": [{"op": "mirror"}], "keep_days": value})
    assert job_fields({"keep_days": 3.0}, NewJobBody).keep_days == 3


def test_numbers_of_a_query_are_texts() -> None:
    assert job_fields({"keep_days": "3", "fail_early": "0.5"}).keep_days == 3
