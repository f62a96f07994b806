"""Results of the client against the documented API, and against servers of other releases."""

from __future__ import annotations

import dataclasses
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from marey.client.results import Result
from marey.client.types import evaluations, jobs, models, motions, references, schedules, streams, webhooks
from marey.client.types.common import ErrorDetail, File
from marey.client.types.evaluations import Comparison
from marey.client.types.jobs import Job, JobItem
from marey.client.types.motions import Motion, MotionDetail
from marey.core.errors import InvalidInput

SCHEMAS = json.loads((Path(__file__).resolve().parents[3] / "docs" / "openapi.json").read_text())["components"][
    "schemas"
]
MODULES = (evaluations, jobs, models, motions, references, schedules, streams, webhooks)
NAMES = {
    File: "FileView", ErrorDetail: "ErrorView",
    jobs.Counters: "CountersView",
    jobs.Job: "JobView",
    jobs.SubmittedJob: "SubmittedView",
    jobs.Edits: "EditsView",
    jobs.JobItem: "ItemView",
    jobs.JobEvent: "EventView",
    jobs.Speed: "SpeedView",
    jobs.Estimate: "EstimateView",
    jobs.Quota: "QuotaBody",
    jobs.CheckedJob: "CheckedView",
    jobs.CheckedEdit: "CheckedEditView",
    jobs.Scope: "ScopeView",
    jobs.NamedAction: "NamedActionView",
    jobs.ScopeExample: "ScopeExampleView",
    jobs.ScopeReport: "ScopeReportView",
    jobs.QualityCounts: "QualityCountsView",
    jobs.QueuePosition: "QueueView",
    jobs.Erasure: "ErasureView",
    motions.Review: "ReviewView",
    motions.Motion: "MotionView",
    motions.MotionDetail: "MotionDetailView",
    motions.MotionQuality: "MotionQuality",
    motions.ConstraintError: "ConstraintError",
    motions.PromptMatch: "PromptMatch",
    motions.Candidate: "Candidate",
    motions.Selection: "Selection",
    motions.Reroll: "RerollView",
    streams.StreamPrompt: "PromptView",
    streams.StreamSkeleton: "SkeletonView",
    streams.Stream: "StreamView",
    streams.StreamDetail: "StreamDetailView",
    models.TrainingData: "DataView",
    models.Model: "ModelView",
    models.SamplingSetting: "SettingView",
    models.ModelActions: "ActionsView",
    models.BrokenModel: "BrokenView",
    models.ModelCatalogue: "ModelsView",
    evaluations.EvaluationRequest: "RequestView",
    evaluations.EvaluationJob: "EvaluationJobView",
    evaluations.EvaluationEvent: "EvaluationEventView",
    evaluations.Evaluation: "EvaluationView",
    evaluations.EvaluationDetail: "EvaluationDetailView",
    evaluations.ComparedRun: "ComparedView",
    evaluations.MetricChange: "MetricChangeView",
    evaluations.MetricPair: "MetricPairView",
    evaluations.Comparison: "ComparisonView",
    schedules.Schedule: "ScheduleView",
    webhooks.Webhook: "WebhookView",
    webhooks.WebhookSecret: "MadeWebhookView",
    webhooks.Delivery: "DeliveryView",
    webhooks.DeliveryDetail: "DeliveryDetailView",
    webhooks.DeliveryAttempt: "AttemptView",
    references.ReferenceMatch: "MatchView",
    references.Resolution: "ResolutionView",
}  # fmt: skip
KINDS = {"string": str, "integer": int, "number": float, "boolean": bool}


def sample(schema: dict[str, Any]) -> Any:
    """A value of a schema."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        found = SCHEMAS[name]
        if "enum" in found:
            return found["enum"][0]
        return {field: sample(each) for field, each in found["properties"].items()}
    if "anyOf" in schema:
        return sample(schema["anyOf"][0])
    kind = schema.get("type")
    if kind == "array":
        items = schema.get("items") or {"type": "number"}
        return [sample(items)]
    if kind == "object":
        return {}
    if kind == "string":
        return "2026-11-24T08:05:00Z" if schema.get("format") == "date-time" else schema.get("enum", ["text"])[0]
    return {"integer": 3, "number": 2, "boolean": True}.get(kind, 0)


def test_every_class_of_results_is_compared() -> None:
    named = [each for module in MODULES for each in vars(module).values()]
    known = {each for each in named if isinstance(each, type) and issubclass(each, Result)}
    assert known - {Result} == set(NAMES)


@pytest.mark.parametrize("kind", NAMES, ids=lambda kind: kind.__name__)
def test_fields_are_those_of_the_api(kind: type[Result]) -> None:
    schema = SCHEMAS[NAMES[kind]]
    assert {each.name for each in dataclasses.fields(kind)} - {"raw"} == set(schema["properties"])
    found = kind.of({name: sample(each) for name, each in schema["properties"].items()})
    for name, each in schema["properties"].items():
        value = getattr(found, name)
        if "$ref" not in each and each.get("format") == "date-time":
            assert value == datetime(2026, 11, 24, 8, 5, tzinfo=UTC)
        elif "$ref" not in each and each.get("type") in KINDS:
            assert type(value) is KINDS[each["type"]], name


def test_fields_of_a_newer_server_are_in_raw_alone() -> None:
    sent = {"id": "a", "state": "hibernating", "counters": {"ready": 1, "postponed": 2}, "weight": 3}
    job = Job.of(sent)
    assert (job.id, job.state, job.counters.ready) == ("a", "hibernating", 1)
    assert not job.has_ended
    assert job.raw["weight"] == 3
    assert job.counters.raw["postponed"] == 2
    assert not hasattr(job, "weight")


def test_fields_that_an_older_server_does_not_send_have_their_defaults() -> None:
    item = JobItem.of({"id": "a", "motion": {"id": "b", "fps": 20, "frames": 40}, "seconds": None})
    assert (item.prompt, item.tags, item.settings, item.seconds, item.error) == ("", (), {}, None, None)
    assert item.motion is not None
    assert (item.motion.seconds, item.motion.fps, item.motion.review, item.motion.files) == (2.0, 20.0, None, ())
    assert isinstance(item.motion.fps, float)


def test_a_detail_is_a_view_with_more() -> None:
    detail = MotionDetail.of({"id": "b", "metadata": {"rewritten": "a man waves"}})
    assert isinstance(detail, Motion)
    assert detail.metadata == {"rewritten": "a man waves"}


@pytest.mark.parametrize(
    "found", [{}, [], None, "job", {"id": "a", "created": "yesterday"}, {"id": "a", "counters": 3}]
)
def test_an_answer_that_is_no_such_object_is_an_error(found: object) -> None:
    with pytest.raises(InvalidInput, match="is not a"):
        Job.of(found)


def test_results_are_frozen_and_compare_by_their_fields() -> None:
    job = Job.of({"id": "a", "extra": 1})
    assert job == Job(id="a")
    with pytest.raises(dataclasses.FrozenInstanceError):
        job.id = "b"  # type: ignore[misc]


def test_a_comparison_needs_both_runs() -> None:
    with pytest.raises(InvalidInput):
        Comparison.of({"before": {"id": "a"}})
