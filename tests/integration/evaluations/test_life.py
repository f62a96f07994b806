"""Evaluations from planned to done, and what they are compared with: scheduler, real handlers in a real loop."""

from __future__ import annotations

from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, NotFound
from marey.core.settings import Settings
from marey.db import transaction
from marey.evaluations import EvaluationRow, EvaluationState
from marey.items.evaluation_prompts import EvaluationPrompt
from marey.jobs import get_job
from marey.scheduler.evaluations import EvaluationScheduler
from marey.storage import FolderStore
from marey.takes import erase
from marey.tenants import DEFAULT_TENANT
from tests.servers.audit import audit as audit_tables
from tests.support.evaluations import (
    GENERATOR,
    JUDGE,
    PROMPTS,
    ToyEvaluator,
    evaluation_row,
    finish,
    history,
    new_evaluation,
    write_evaluator,
    write_generator,
)
from tests.support.runtime import Loop
from tests.support.toy import ToyHandler, ToyTextHandler
from tests.support.toy_jobs import audit

S = EvaluationState


def failing(count: int, total: int) -> list[EvaluationPrompt]:
    """So many prompts, of which some cannot be made."""
    return [EvaluationPrompt(f"{'refuse' if n < count else 'walk'} {n} steps") for n in range(total)]


def test_an_evaluation_is_generated_in_the_background_then_scored_and_reported(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator, folder_store: FolderStore
) -> None:
    evaluation = new_evaluation(engine, repeats=2)
    row = finish(scheduler, loop, engine, evaluation)
    assert (row.state, row.reason) == (S.DONE, "6 motions measured")
    assert row.summary == {"made": 6.0, "bytes": row.summary["bytes"], "fid": None}
    assert [file.format for file in row.reports] == ["html", "json", "md"]
    assert history(engine, evaluation) == ["planned", "generating", "scoring", "done"]
    assert row.generation is not None
    assert row.scoring is not None
    with transaction(engine) as conn:
        for job in (row.generation.id, row.scoring.id):
            assert get_job(conn, DEFAULT_TENANT, job).priority == -1000
    assert audit(engine, folder_store) == []
    with transaction(engine) as conn:
        assert audit_tables(conn) == []
    content = folder_store.get(f"t/default/{row.reports[2].sha256[:2]}/{row.reports[2].sha256}")
    assert content == f"# 6 motions of {evaluation}\n".encode()
    assert len(judge.seen) == 1


def test_prompts_of_an_evaluation_are_not_erased_by_its_job(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine))
    assert row.generation is not None
    with pytest.raises(Conflict, match=f"evaluation {row.id} made it"), transaction(engine) as conn:
        erase(conn, DEFAULT_TENANT, row.generation.id, by="ann")


def test_the_evaluator_sees_every_motion_in_input_order_with_what_was_expected(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    finish(scheduler, loop, engine, new_evaluation(engine, repeats=2))
    (score,) = judge.seen
    assert [(i.index, i.variant, i.prompt, i.expected, i.seconds) for i in score.items] == [
        (0, 0, "walk", "walk", 2.0), (0, 1, "walk", "walk", 2.0),
        (1, 0, "walk away", None, None), (1, 1, "walk away", None, None),
        (2, 0, "walk on", None, 3.0), (2, 1, "walk on", None, 3.0),
    ]  # fmt: skip
    assert [i.seed for i in score.items] == [7, 8, 9, 10, 11, 12]
    assert all(score.npz(i).endswith(f" {i.seed}".encode()) for i in score.items)
    assert score.request.bundle.startswith(f"{GENERATOR}@")
    assert score.request.evaluator is not None
    assert score.request.evaluator.startswith(f"{JUDGE}@")
    assert (score.request.model, score.previous, score.baseline) == ("toy", None, None)


def test_the_captions_of_the_evaluators_bundle_are_generated_as_long_as_the_model_can(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine, None))
    assert (row.state, row.request.source, row.prompt_count) == (S.DONE, "test", 3)
    assert [(i.prompt, i.expected, i.seconds) for i in judge.seen[0].items] == [
        ("walk", "walk", 3.0), ("walk and wave", "walk then wave left", 9.8), ("walk as a guide", None, 0.8),
    ]  # fmt: skip


def test_motions_that_were_not_made_are_told_to_the_evaluator(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine, failing(1, 100)))  # just 1 %
    assert (row.state, row.summary and row.summary["made"]) == (S.DONE, 99.0)
    (refused,) = [item for item in judge.seen[0].items if item.npz is None]
    assert refused.problem is not None
    assert (refused.index, str(refused.state), refused.problem.message) == (0, "failed", "this cannot be danced")
    with pytest.raises(NotFound, match="no motion"):
        judge.seen[0].npz(refused)


def test_more_than_one_percent_of_failed_motions_fail_the_report(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine, failing(2, 100)))
    assert row.state is S.FAILED
    assert row.reason.startswith("2 of 100 motions are missing, 2.0%; the limit is 1%")
    assert row.reason.endswith("the first: this cannot be danced")
    assert (row.summary, row.reports, judge.seen) == (None, (), [])


# --- what it is compared with ---


class Other(ToyHandler):
    """Another model."""

    queue = "other"


def test_a_run_is_not_compared_with_one_of_another_model(
    engine: sa.Engine, scheduler: EvaluationScheduler, folder_store: FolderStore, judge: ToyEvaluator, config: Settings
) -> None:
    write_generator(config.models, "other-starter", model="other")
    loop = Loop(engine, folder_store, ToyTextHandler(), ToyHandler(), Other(), judge)
    try:
        for bundle in (GENERATOR, "other-starter"):
            assert finish(scheduler, loop, engine, new_evaluation(engine, bundle=bundle)).state is S.DONE
    finally:
        loop.close()
    assert [(score.request.model, score.history) for score in judge.seen] == [("toy", ()), ("other", ())]


def test_a_run_is_compared_with_the_last_of_the_same_model_prompts_and_evaluator(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator, config: Settings
) -> None:
    first = new_evaluation(engine)
    finish(scheduler, loop, engine, first)
    finish(scheduler, loop, engine, new_evaluation(engine, PROMPTS[:2]))  # other prompts
    write_generator(config.models, weight=1.0)  # a new training of the same model is just what is compared
    second = new_evaluation(engine)
    row = finish(scheduler, loop, engine, second)
    assert [run.id for run in judge.seen[-1].history] == [first]
    assert row.regressed is False
    write_evaluator(config.models, weight=1.0)  # another space: other numbers
    assert finish(scheduler, loop, engine, new_evaluation(engine)).regressed is None
    assert judge.seen[-1].history == ()


def report_digest(engine: sa.Engine, evaluation: UUID) -> str:
    query = sa.text(
        "SELECT sha256 FROM evaluation_report JOIN asset ON asset.id = asset_id "
        "WHERE evaluation_id = :evaluation AND format = 'json'"
    )
    with transaction(engine) as conn:
        return conn.execute(query, {"evaluation": evaluation}).scalar_one()


def test_a_pinned_baseline_stays_the_one_to_compare_with(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    first, second = (new_evaluation(engine) for _ in range(2))
    for each in (first, second):
        finish(scheduler, loop, engine, each)
    row = finish(scheduler, loop, engine, new_evaluation(engine, baseline=first))
    assert row.state is S.DONE
    score = judge.seen[-1]
    assert score.baseline is not None
    assert score.previous is not None
    assert (score.baseline.id, score.previous.id) == (first, second)
    for run in (score.baseline, score.previous):
        assert run.report is not None
        assert run.report.sha256 == report_digest(engine, run.id)
    assert [run.id for run in score.history] == [first, second]


@pytest.mark.parametrize("what", ["prompts", "evaluator", "state"])
def test_a_baseline_of_other_prompts_or_evaluator_or_without_numbers_is_refused(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, config: Settings, what: str
) -> None:
    baseline = new_evaluation(engine, PROMPTS[:2] if what == "prompts" else PROMPTS)
    if what != "state":
        finish(scheduler, loop, engine, baseline)
    if what == "evaluator":
        write_evaluator(config.models, weight=1.0)
    evaluation = new_evaluation(engine, baseline=baseline)
    row = finish(scheduler, loop, engine, evaluation) if what != "state" else step(scheduler, engine, evaluation)
    said = {"prompts": "other prompts", "evaluator": "was measured by judge@", "state": "is planned, not done"}
    assert row.state is S.FAILED
    assert said[what] in row.reason


def step(scheduler: EvaluationScheduler, engine: sa.Engine, evaluation: UUID) -> EvaluationRow:
    """One step of this evaluation alone."""
    scheduler._step(evaluation)
    return evaluation_row(engine, evaluation)
