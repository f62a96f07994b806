"""The OpenAPI document: FastAPI's output, bodies that routes parse themselves, and an example of each body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel

from marey.http import problems

LOCAL_SERVER = "/"
"""The server that serves the document."""
_MOTION = "0199f3a2-6c1d-7b4e-9a55-3f1c2d7e8b90"
_ITEM = {"prompt": "a person walks forward and waves with the right hand", "name": "greeting", "tags": ["shot=010"]}
_MEASURED = {"bundle": "hgm3-starter", "split": "test", "repeats": 3}

EXAMPLES: dict[tuple[str, str], Any] = {
    ("NewJobBody", "application/json"): {
        "name": "day 1",
        "priority": 10,
        "items": [{**_ITEM, "seconds": 4.0, "seed": 7, "variants": 3}, {"prompt": "a person bows", "model": "hgm3"}],
    },
    ("NewItemBody", "application/x-ndjson"): {**_ITEM, "model": "hgm3", "settings": {"guidance": 4.5}},
    ("JobPatch", "application/json"): {"priority": 50, "comment": "for tonight's review"},
    ("NewReviewBody", "application/json"): {"motions": [_MOTION], "verdict": "kept", "comment": "clean feet"},
    ("NewPackBody", "application/json"): {"motions": [_MOTION], "formats": ["npz", "bvh"]},
    ("NewRerollBody", "application/json"): {"motions": [_MOTION], "comment": "slides at the end"},
    ("NewEditBody", "application/json"): {"ops": [{"op": "trim", "from": 0.5, "to": 3.2}, {"op": "loop"}]},
    ("NewStreamBody", "application/json"): {"prompt": "a person walks forward", "seconds": 60.0, "seed": 7},
    ("EndStreamBody", "application/json"): {
        "pose": {"motion": {"id": "01a2185a-bb8d-7f1c-a04c-452b827cd415", "frame": 40}}
    },
    ("ParseBody", "application/json"): {"prompts": ["a person walks forward and waves"], "model": "hgm3"},
    ("NewEvaluationBody", "application/json"): {**_MEASURED, "name": "nightly"},
    ("NewScheduleBody", "application/json"): {**_MEASURED, "cron": "0 3 * * 1", "time_zone": "Europe/Berlin"},
    ("SchedulePatch", "application/json"): {"cron": "30 4 * * *", "paused": False},
    ("NewWebhookBody", "application/json"): {"url": "https://hooks.example.com/marey", "events": ["job.ended"]},
    ("WebhookPatch", "application/json"): {"paused": True},
}
"""Examples by schema and media type of a body."""


def build_reference(app: FastAPI, models: Sequence[type[BaseModel]], public_url: str | None) -> dict[str, Any]:
    """Return the OpenAPI 3.1 document of an application; `docs/openapi.json` is a copy of it.

    Args:
        models: schemas of bodies that routes parse themselves.
        public_url: URL of the API for clients; None = relative to the document.
    """
    document = get_openapi(
        title=app.title,
        version=app.version,
        description=app.description,
        routes=app.routes,
        servers=[{"url": LOCAL_SERVER if public_url is None else public_url.rstrip("/")}],
    )
    schemas = document["components"]["schemas"]
    for model in (*models, problems.ProblemBody):
        schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas.update(schema.pop("$defs", {}))
        schemas[model.__name__] = schema
    _answer_problems(document)
    for schema, media_type, content in _bodies(document):
        content["example"] = EXAMPLES[schema, media_type]
    return document


def _operations(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for path in document["paths"].values():
        yield from path.values()


def _bodies(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Return schema name, media type and description of each body."""
    for operation in _operations(document):
        for media_type, content in operation.get("requestBody", {}).get("content", {}).items():
            if "$ref" in content["schema"]:  # not a file
                yield content["schema"]["$ref"].rpartition("/")[2], media_type, content


def _answer_problems(document: dict[str, Any]) -> None:
    """Replace FastAPI's own 422 by a problem like the others."""
    for operation in _operations(document):
        operation["responses"].pop("422", None)
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)
