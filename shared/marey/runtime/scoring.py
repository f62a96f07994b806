"""Input of a score item: the motions of an evaluation, independent of database and store."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import NotFound
from marey.db import SEARCH, transaction
from marey.evaluations import EarlierRun, EvaluationJob, EvaluationRequest, MadeItem, load_score
from marey.jobs import asset_key
from marey.storage import AssetStore


@dataclass(frozen=True)
class ScoreInput:
    """An evaluation whose motions are made.

    Attributes:
        request: the evaluation request, with exact bundles.
        prompts: digest of its prompts: equal digests are comparable.
        generation: the job that made the motions, with its times.
        items: every requested motion, in input order, repeats (`variant`) within prompt (`index`); failed ones have
            a `problem` and no motion.
        history: the last 20 runs that are done, of the same model and prompts, by the same evaluator; oldest first.
        baseline: the run that the request names for comparison.
    """

    evaluation: UUID
    name: str | None
    request: EvaluationRequest
    prompts: str
    generation: EvaluationJob
    items: tuple[MadeItem, ...]
    history: tuple[EarlierRun, ...]
    baseline: EarlierRun | None
    read: Callable[[str], bytes] = field(repr=False)
    """Reads content by sha256."""

    @property
    def previous(self) -> EarlierRun | None:
        """Last run of `history`."""
        return self.history[-1] if self.history else None

    def npz(self, item: MadeItem) -> bytes:
        """Read the npz of an item's motion; safe to call from several threads.

        Raises:
            NotFound: it has none, or the store has lost it.
            Unreachable: the store does not answer; do not catch it, and the item is released.
        """
        if item.npz is None:
            raise NotFound("there is no motion", where=f"prompt {item.index}, repeat {item.variant}")
        return self.read(item.npz.sha256)


def score_input(engine: sa.Engine, store: AssetStore, job: UUID) -> ScoreInput:
    """Return the input of a job's score item.

    Raises:
        NotFound, Conflict: as `load_score`.
        Unreachable: the database does not answer.
    """
    with transaction(engine, SEARCH) as conn:
        rows = load_score(conn, job)
    evaluation = rows.evaluation
    assert evaluation.prompts is not None  # validated by `load_score`
    assert evaluation.generation is not None
    return ScoreInput(
        evaluation=evaluation.id,
        name=evaluation.name,
        request=evaluation.request,
        prompts=evaluation.prompts,
        generation=evaluation.generation,
        items=rows.items,
        history=rows.history,
        baseline=rows.baseline,
        read=lambda sha256: store.get(asset_key(evaluation.tenant, sha256)),
    )
