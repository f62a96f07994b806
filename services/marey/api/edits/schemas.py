"""Bodies of the routes of edits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, WithJsonSchema

from marey.api.jobs.estimates import EstimateView
from marey.api.jobs.schemas import SCOPE, CommonJobFields, ScopeReportView
from marey.http.fields import MAX_MODEL, SAMPLING
from marey.http.problems import QuotaBody
from marey.http.schemas import JsonBody, View
from marey.items.values import MODEL_PATTERN
from marey.motion.edits.steps import MOST
from marey.motion.edits.table import OPERATIONS
from marey.vocabulary.scope import ScopePolicy


def _schema() -> Mapping[str, Any]:
    """Describe an operation; `marey.motion.edits.steps` checks which parameters each has."""
    about = dict[str, str]()
    for operation in OPERATIONS.values():
        for each in operation.parameters:
            before = f"{about[each.name]} " if each.name in about else ""
            about[each.name] = f"{before}`{operation.name}`: {each.about}"
    op = {"type": "string", "enum": [*OPERATIONS], "description": "The operation."}
    parameters = {name: {"description": text} for name, text in about.items()}
    return {"type": "object", "required": ["op"], "properties": {"op": op, **parameters}}


EditOperation = Annotated[dict[str, Any], WithJsonSchema(dict(_schema()))]


class NewEditBody(CommonJobFields, JsonBody):
    """Operations on a motion, as a job."""

    model: str | None = Field(
        None,
        max_length=MAX_MODEL,
        pattern=MODEL_PATTERN,  # a path would be one of the server's
        description="Model, bundle or exact bundle that generates frames, for operations that need one; default: the "
        "server's.",
    )
    settings: dict[str, float] = Field(
        default_factory=dict[str, float], description="Of sampling, for the model.", json_schema_extra=SAMPLING
    )
    scope: ScopePolicy = Field("warn", description=SCOPE)
    ops: list[EditOperation] = Field(
        min_length=1,
        max_length=MOST,
        description="Operations, applied in their order; `with` is the id of another motion. Each `split` makes "
        "two motions of one.",
    )


class CheckedEditView(View):
    """The answer to `validate_only` of an edit."""

    valid: bool
    items: int
    """Number of resulting motions."""
    bundles: list[str] = Field(description="The bundle that generates frames; `edit` if no model is needed.")
    prompts: list[str] = Field(description="Prompts of the resulting motions, in their order.")
    estimate: EstimateView
    quotas: list[QuotaBody] = Field(
        description="The tenant's quotas of queued items and of bytes, with the capacity left."
    )
    waiting: int = Field(description="Items of all tenants that wait for the same workers.")
    scope_report: ScopeReportView | None = Field(
        description="Of prompts that the operations have; null with scope `ignore`, and without a model."
    )
    warnings: list[str]
