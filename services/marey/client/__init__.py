"""The Python client of a Marey server.

    from marey.client import Client

    with Client("https://marey.example.com", key) as client:
        job = client.jobs.submit(["a person waves"], seed=1)
        client.jobs.wait(job)
        client.jobs.fetch(job, "clips")

What `__all__` names is public and documented in `docs/reference/python-api.md`; the modules of this package are not.
Names are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.core.lazy import lazy_names

if TYPE_CHECKING:
    from marey.client.client import Client
    from marey.client.evaluation_requests import EvaluationOptions
    from marey.client.fetching import FetchObserver
    from marey.client.frames import Frame
    from marey.client.job_requests import Defaults, JobChanges
    from marey.client.job_results import FetchedItem, Progress
    from marey.client.results import Result
    from marey.client.schedules import ScheduleChanges
    from marey.client.server_address import Server
    from marey.client.streams import FramesMissing, LiveStream, StreamChanged, StreamProblem
    from marey.client.types.common import ErrorDetail, File
    from marey.client.types.evaluations import (
        ComparedRun,
        Comparison,
        Evaluation,
        EvaluationDetail,
        EvaluationEvent,
        EvaluationJob,
        EvaluationRequest,
        MetricChange,
        MetricPair,
    )
    from marey.client.types.jobs import (
        CheckedEdit,
        CheckedJob,
        Counters,
        Edits,
        Erasure,
        Estimate,
        Job,
        JobEvent,
        JobItem,
        NamedAction,
        QualityCounts,
        QueuePosition,
        Quota,
        Scope,
        ScopeExample,
        ScopeReport,
        Speed,
        SubmittedJob,
    )
    from marey.client.types.models import (
        BrokenModel,
        Model,
        ModelActions,
        ModelCatalogue,
        SamplingSetting,
        TrainingData,
    )
    from marey.client.types.motions import (
        Candidate,
        ConstraintError,
        Motion,
        MotionDetail,
        MotionQuality,
        PromptMatch,
        Reroll,
        Review,
        Selection,
    )
    from marey.client.types.references import ReferenceMatch
    from marey.client.types.rigs import Rig, RigDetail
    from marey.client.types.schedules import Schedule
    from marey.client.types.streams import Stream, StreamDetail, StreamPrompt, StreamSkeleton
    from marey.client.types.webhooks import Delivery, DeliveryAttempt, DeliveryDetail, Webhook, WebhookSecret
    from marey.client.webhooks import WebhookChanges
    from marey.core.errors import (
        Busy,
        Conflict,
        InvalidBundle,
        InvalidFile,
        InvalidInput,
        ItemsFailed,
        MareyError,
        NotFound,
        Overloaded,
        QuotaUsedUp,
        Refused,
        Regressed,
        TimedOut,
        TooLarge,
        TooSlow,
        Unauthenticated,
        Unreachable,
    )
    from marey.items.evaluation_prompts import EvaluationPrompt
    from marey.items.item import Item
    from marey.items.problems import InvalidItems, OutOfScope, Problem

    __version__: str

__getattr__ = lazy_names(
    __name__,
    {
        "marey.client.client": "Client",
        "marey.client.evaluation_requests": "EvaluationOptions",
        "marey.client.fetching": "FetchObserver",
        "marey.client.frames": "Frame",
        "marey.client.job_requests": "Defaults JobChanges",
        "marey.client.job_results": "FetchedItem Progress",
        "marey.client.server_address": "Server",
        "marey.client.results": "Result",
        "marey.client.schedules": "ScheduleChanges",
        "marey.client.streams": "FramesMissing LiveStream StreamChanged StreamProblem",
        "marey.client.types.common": "ErrorDetail File",
        "marey.client.types.evaluations": (
            "ComparedRun Comparison Evaluation EvaluationDetail EvaluationEvent EvaluationJob "
            "EvaluationRequest MetricChange MetricPair"
        ),
        "marey.client.types.jobs": (
            "CheckedEdit CheckedJob Counters Edits Erasure Estimate Job JobEvent JobItem NamedAction QualityCounts "
            "QueuePosition Quota Scope ScopeExample ScopeReport Speed SubmittedJob"
        ),
        "marey.client.types.models": "BrokenModel Model ModelActions ModelCatalogue SamplingSetting TrainingData",
        "marey.client.types.motions": (
            "Candidate ConstraintError Motion MotionDetail MotionQuality PromptMatch Reroll Review Selection"
        ),
        "marey.client.types.references": "ReferenceMatch",
        "marey.client.types.rigs": "Rig RigDetail",
        "marey.client.types.schedules": "Schedule",
        "marey.client.types.streams": "Stream StreamDetail StreamPrompt StreamSkeleton",
        "marey.client.types.webhooks": "Delivery DeliveryAttempt DeliveryDetail Webhook WebhookSecret",
        "marey.client.webhooks": "WebhookChanges",
        "marey.core.errors": (
            "Busy Conflict InvalidBundle InvalidFile InvalidInput ItemsFailed MareyError NotFound "
            "Overloaded QuotaUsedUp Refused Regressed TimedOut TooLarge TooSlow Unauthenticated "
            "Unreachable"
        ),
        "marey.items.evaluation_prompts": "EvaluationPrompt",
        "marey.items.item": "Item",
        "marey.items.problems": "InvalidItems OutOfScope Problem",
    },
)

__all__ = [
    "BrokenModel",
    "Busy",
    "Candidate",
    "CheckedEdit",
    "CheckedJob",
    "Client",
    "ComparedRun",
    "Comparison",
    "Conflict",
    "ConstraintError",
    "Counters",
    "Defaults",
    "Delivery",
    "DeliveryAttempt",
    "DeliveryDetail",
    "Edits",
    "Erasure",
    "ErrorDetail",
    "Estimate",
    "Evaluation",
    "EvaluationDetail",
    "EvaluationEvent",
    "EvaluationJob",
    "EvaluationOptions",
    "EvaluationPrompt",
    "EvaluationRequest",
    "FetchObserver",
    "FetchedItem",
    "File",
    "Frame",
    "FramesMissing",
    "InvalidBundle",
    "InvalidFile",
    "InvalidInput",
    "InvalidItems",
    "Item",
    "ItemsFailed",
    "Job",
    "JobChanges",
    "JobEvent",
    "JobItem",
    "LiveStream",
    "MareyError",
    "MetricChange",
    "MetricPair",
    "Model",
    "ModelActions",
    "ModelCatalogue",
    "Motion",
    "MotionDetail",
    "MotionQuality",
    "NamedAction",
    "NotFound",
    "OutOfScope",
    "Overloaded",
    "Problem",
    "Progress",
    "PromptMatch",
    "QualityCounts",
    "QueuePosition",
    "Quota",
    "QuotaUsedUp",
    "ReferenceMatch",
    "Refused",
    "Regressed",
    "Reroll",
    "Result",
    "Review",
    "Rig",
    "RigDetail",
    "SamplingSetting",
    "Schedule",
    "ScheduleChanges",
    "Scope",
    "ScopeExample",
    "ScopeReport",
    "Selection",
    "Server",
    "Speed",
    "Stream",
    "StreamChanged",
    "StreamDetail",
    "StreamProblem",
    "StreamPrompt",
    "StreamSkeleton",
    "SubmittedJob",
    "TimedOut",
    "TooLarge",
    "TooSlow",
    "TrainingData",
    "Unauthenticated",
    "Unreachable",
    "Webhook",
    "WebhookChanges",
    "WebhookSecret",
    "__version__",
]
