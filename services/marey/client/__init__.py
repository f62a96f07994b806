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
    from marey.client.frames import Frame
    from marey.client.jobs import Defaults, FetchedItem, JobChanges, Progress
    from marey.client.place import Server
    from marey.client.results import Result
    from marey.client.streams import LiveStream
    from marey.client.types import (
        CheckedJob,
        ComparedRun,
        Comparison,
        Counters,
        Erasure,
        ErrorDetail,
        Estimate,
        Evaluation,
        EvaluationDetail,
        EvaluationEvent,
        EvaluationJob,
        EvaluationRequest,
        File,
        Job,
        JobEvent,
        JobItem,
        MetricChange,
        MetricPair,
        Model,
        Motion,
        MotionDetail,
        QueuePosition,
        Quota,
        Reroll,
        Review,
        SamplingSetting,
        Speed,
        Stream,
        StreamDetail,
        StreamPrompt,
        StreamSkeleton,
        TrainingData,
    )
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
    from marey.items.item import InvalidItems, Item, Problem

    __version__: str

__getattr__ = lazy_names(
    __name__,
    {
        "marey.client.client": "Client",
        "marey.client.frames": "Frame",
        "marey.client.jobs": "Defaults FetchedItem JobChanges Progress",
        "marey.client.place": "Server",
        "marey.client.results": "Result",
        "marey.client.streams": "LiveStream",
        "marey.client.types": (
            "CheckedJob ComparedRun Comparison Counters Erasure ErrorDetail Estimate Evaluation "
            "EvaluationDetail EvaluationEvent EvaluationJob EvaluationRequest File Job JobEvent JobItem "
            "MetricChange MetricPair Model Motion MotionDetail QueuePosition Quota Reroll Review "
            "SamplingSetting Speed Stream StreamDetail StreamPrompt StreamSkeleton TrainingData"
        ),
        "marey.core.errors": (
            "Busy Conflict InvalidBundle InvalidFile InvalidInput ItemsFailed MareyError NotFound "
            "Overloaded QuotaUsedUp Refused Regressed TimedOut TooLarge TooSlow Unauthenticated "
            "Unreachable"
        ),
        "marey.items.evaluation_prompts": "EvaluationPrompt",
        "marey.items.item": "InvalidItems Item Problem",
    },
)

__all__ = [
    "Busy",
    "CheckedJob",
    "Client",
    "ComparedRun",
    "Comparison",
    "Conflict",
    "Counters",
    "Defaults",
    "Erasure",
    "ErrorDetail",
    "Estimate",
    "Evaluation",
    "EvaluationDetail",
    "EvaluationEvent",
    "EvaluationJob",
    "EvaluationPrompt",
    "EvaluationRequest",
    "FetchedItem",
    "File",
    "Frame",
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
    "Motion",
    "MotionDetail",
    "NotFound",
    "Overloaded",
    "Problem",
    "Progress",
    "QueuePosition",
    "Quota",
    "QuotaUsedUp",
    "Refused",
    "Regressed",
    "Reroll",
    "Result",
    "Review",
    "SamplingSetting",
    "Server",
    "Speed",
    "Stream",
    "StreamDetail",
    "StreamPrompt",
    "StreamSkeleton",
    "TimedOut",
    "TooLarge",
    "TooSlow",
    "TrainingData",
    "Unauthenticated",
    "Unreachable",
    "__version__",
]
