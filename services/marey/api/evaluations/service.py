"""Validation of evaluation requests, before anything is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import sqlalchemy as sa

from marey import db, evaluations, tenants
from marey.api.audit import note
from marey.api.context import Context
from marey.api.documents import Document
from marey.api.evaluations.schemas import EvaluationDetailView, EvaluationFields, NewEvaluationBody
from marey.api.jobs.service import Fields, read_fields, request_sha256
from marey.core.errors import InvalidInput, NotFound
from marey.core.settings import Settings
from marey.evaluations.requests import EvaluationPlan, plan_evaluation
from marey.items.evaluation_prompts import MAX_PROMPTS, EvaluationPrompt, read_prompts
from marey.items.item import CHECKS
from marey.items.problems import InvalidItems, Problem

OWN_PROMPTS = "prompts"
"""Default name of custom prompts."""
HINT = 'Write {"bundle": "hgm3", "split": "test"}, or "prompts": [{"prompt": "…"}] in place of the split.'


@dataclass(frozen=True)
class ParsedEvaluation:
    """A parsed evaluation request."""

    request: evaluations.EvaluationRequest
    prompts: tuple[EvaluationPrompt, ...] | None
    """None = those of the evaluator's bundle."""

    def planned(self, config: Settings) -> EvaluationPlan:
        """Return the plan that would run now.

        Raises:
            InvalidItems, InvalidInput, InvalidBundle, Refused: it cannot run.
        """
        try:
            return plan_evaluation(self.request, self.prompts, config)
        except NotFound as error:  # the problem is a field's, not the path's
            raise InvalidInput(error.message, where=error.where, hint=error.hint) from error


def prompts_document(body: BinaryIO, *, at: tuple[str, ...] = ("prompts",), hint: str = HINT) -> Document:
    """Return the document of a body whose prompts are at a path."""
    return Document(body, at, hint=hint, limit=MAX_PROMPTS)


def parse_evaluation(
    model: type[Fields], values: Mapping[str, Any], document: Document
) -> tuple[Fields, ParsedEvaluation]:
    """Parse the fields of a body, which include those of an evaluation, and its prompts.

    Args:
        values: fields beside the prompts in `document`; and the value in their place, if that is not a list.

    Raises:
        InvalidItems: with the problems of all fields, or of all prompts.
        InvalidInput: neither a split nor prompts, or both.
    """
    if document.is_cut:  # other fields may follow the list
        read_prompts(document.elements(), where="prompts")
    others = dict(values)
    other = others.pop("prompts", None)
    fields = read_fields(model, others)
    if other is not None:
        raise InvalidInput("is not a list", where="prompts", hint=HINT)
    assert isinstance(fields, EvaluationFields)
    return fields, _parsed(fields, document)


def create(
    shared: Context, key: tenants.ApiKey, body: BinaryIO, idempotency_key: str | None
) -> tuple[EvaluationDetailView, bool]:
    """Plan an evaluation, or return the one that an earlier request with this key and body has planned; the flag says
    which.

    Raises:
        InvalidItems, InvalidInput, InvalidBundle, Refused: see `parse_evaluation` and `ParsedEvaluation.planned`.
        IdempotencyMismatch: the key was used with another request.
    """
    document = prompts_document(body)
    fields, asked = parse_evaluation(NewEvaluationBody, document.fields(), document)
    plan = asked.planned(shared.config)
    with db.transaction(shared.engine) as conn:
        sha256 = stored(conn, key.tenant, plan)
        new = evaluations.NewEvaluation(
            key.tenant,
            plan.request,
            sha256,
            name=fields.name,
            comment=fields.comment,
            idempotency_key=idempotency_key,
            body_sha256=request_sha256("evaluations", body) if idempotency_key else None,
        )
        made = evaluations.create_evaluation(conn, new)
        assert made is not None  # only one of a schedule can exist already
        replayed = made != new.id
        if not replayed:
            note(conn, key, "evaluation.begin", made, bundle=plan.request.bundle)
        return detail(conn, evaluations.get_evaluation(conn, key.tenant, made)), replayed


def stored(conn: sa.Connection, tenant: str, plan: EvaluationPlan) -> str:
    """Store the prompts of a plan and return their digest. Validates the baseline, too.

    Raises:
        InvalidInput: the baseline is not comparable.
    """
    sha256 = evaluations.store_prompts(conn, tenant, plan.prompts)
    evaluations.check_baseline(conn, tenant, plan.request, sha256)
    return sha256


def detail(conn: sa.Connection, row: evaluations.EvaluationRow) -> EvaluationDetailView:
    """Return an evaluation with its history."""
    return EvaluationDetailView.detail(
        row, evaluations.evaluation_events(conn, row.id), evaluations.evaluation_waits_for(conn, row)
    )


def _parsed(fields: EvaluationFields, document: Document) -> ParsedEvaluation:
    if document.has_list == (fields.split is not None):
        what = "both are given" if document.has_list else "neither is given"
        raise InvalidInput(f"an evaluation has a split or prompts, and {what}", where="split, prompts", hint=HINT)
    prompts = read_prompts(document.elements(), where="prompts") if fields.split is None else None
    source = (fields.split if prompts is None else fields.source) or OWN_PROMPTS
    if prompts is not None and source in evaluations.BUNDLE_SOURCES:
        raise InvalidInput(f"{source!r} is reserved for the evaluator's own prompts", where="source")
    request = evaluations.EvaluationRequest(
        bundle=fields.bundle,
        evaluator=fields.evaluator,
        source=source,
        settings=_settings(fields.settings),
        repeats=fields.repeats,
        seed=fields.seed,
        baseline=fields.baseline,
    )
    return ParsedEvaluation(request, prompts)


def _settings(given: Mapping[str, Any] | None) -> Any:
    """Validate settings as those of an item."""
    if given is None:
        return {}
    try:
        return CHECKS["settings"](given)
    except InvalidInput as error:
        raise InvalidItems([Problem(None, "settings", error.message)]) from error
