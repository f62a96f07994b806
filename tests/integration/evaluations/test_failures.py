"""Evaluations that end without a report: missing things, refusals, operators."""

from __future__ import annotations

import threading
from typing import Any

import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput
from marey.core.settings import Settings
from marey.db import transaction
from marey.evaluations import EvaluationState, NewScore, cancel_evaluation, commit_score
from marey.items.evaluation_prompts import EvaluationPrompt
from marey.jobs import AssetDigest, JobState, begin_assets, cancel, claim, sweep
from marey.scheduler.evaluations import EvaluationScheduler
from marey.storage import FolderStore
from marey.takes import collect_garbage, delete
from marey.tenants import DEFAULT_TENANT
from tests.servers.audit import audit as audit_tables
from tests.support.evaluations import (
    GENERATOR,
    PROMPTS,
    ToyEvaluator,
    bring_to,
    evaluation_row,
    finish,
    history,
    jobs_there,
    new_evaluation,
    state_of,
    wait,
    write_evaluator,
)
from tests.support.runtime import Loop
from tests.support.toy_jobs import audit

S = EvaluationState


def test_a_deleted_bundle_fails_the_evaluation_with_the_reason_and_submits_nothing(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    evaluation = new_evaluation(engine, bundle="gone")
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert row.state is S.FAILED
    assert "no model or bundle is named 'gone'" in row.reason
    assert jobs_there(engine) == 0


def test_a_bundle_that_was_replaced_since_is_not_measured_in_place_of_it(
    engine: sa.Engine, scheduler: EvaluationScheduler, config: Settings
) -> None:
    evaluation = new_evaluation(engine, bundle=f"{GENERATOR}@{'0' * 12}")
    scheduler.round()
    assert "not 000000000000" in evaluation_row(engine, evaluation).reason


def test_lengths_that_the_bundle_cannot_make_fail_the_evaluation_before_anything_is_made(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    evaluation = new_evaluation(engine, [*PROMPTS, EvaluationPrompt("walk far", 30.0)])
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, jobs_there(engine)) == (S.FAILED, 0)
    assert "1 prompts cannot be made; the first: line 4: seconds: 30 is outside 0.8 to 9.8" in row.reason


@pytest.mark.parametrize(
    ("judge", "message"),
    [
        ({"skeleton": "hands"}, "of the skeleton hands; toy-starter makes them of humanml3d"),
        ({"layout": "humanml3d-259"}, "of the feature layout humanml3d-259; toy-starter makes them of humanml3d-263"),
        ({"fps": 30.0}, "of the frame rate 30.0; toy-starter makes them of 20.0"),
    ],
)
def test_an_evaluator_of_other_motion_is_refused_before_anything_is_made(
    engine: sa.Engine, scheduler: EvaluationScheduler, config: Settings, judge: dict[str, Any], message: str
) -> None:
    write_evaluator(config.models, "judge-of-others", **judge)
    evaluation = new_evaluation(engine, evaluator="judge-of-others")
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, jobs_there(engine)) == (S.FAILED, 0)
    assert f"judge-of-others measures motions {message}" in row.reason


def test_an_evaluator_that_refuses_fails_the_evaluation_with_its_message(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    judge.problems = [InvalidInput("the motions are of another skeleton")]
    row = finish(scheduler, loop, engine, new_evaluation(engine))
    assert row.state is S.FAILED
    assert "the motions are of another skeleton" in row.reason
    assert row.reports == ()


def test_a_bug_of_the_evaluator_is_tried_again(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    judge.problems = [RuntimeError("a bug")]
    evaluation = new_evaluation(engine)
    bring_to(scheduler, loop, engine, evaluation, S.SCORING)
    loop.run()
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE item SET run_after = now() WHERE run_after IS NOT NULL"))
    sweep(engine)
    assert finish(scheduler, loop, engine, evaluation).state is S.DONE
    assert len(judge.seen) == 2


def test_a_report_with_a_number_that_is_none_is_not_written(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop
) -> None:
    evaluation = new_evaluation(engine)
    bring_to(scheduler, loop, engine, evaluation, S.SCORING)
    digest = AssetDigest("0" * 64, 1)
    with transaction(engine) as conn:
        claimed = claim(conn, "evaluator", "w", 1)
        assert claimed is not None
        begin_assets(conn, claimed.lease_token, [digest])
    for summary, files, said in (
        ({"fid": float("nan")}, {"md": digest}, "no measure: fid"),
        ({"fid": 1.0}, {"exe": digest}, "formats"),
        ({}, {}, "formats"),
    ):
        score = NewScore(claimed.items[0].id, files, summary, None, "done")
        with pytest.raises(ValueError, match=said), transaction(engine) as conn:
            commit_score(conn, claimed.lease_token, score)
    assert state_of(engine, evaluation) is S.SCORING


def test_a_generation_whose_motions_an_operator_cancelled_cancels_the_evaluation(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop
) -> None:
    evaluation = new_evaluation(engine)
    bring_to(scheduler, loop, engine, evaluation, S.GENERATING)
    generation = evaluation_row(engine, evaluation).generation
    assert generation is not None
    with transaction(engine) as conn:
        cancel(conn, DEFAULT_TENANT, generation.id)
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, str(generation.id) in row.reason) == (S.CANCELLED, True)


def test_a_job_that_an_open_evaluation_needs_cannot_be_deleted(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop
) -> None:
    evaluation = new_evaluation(engine)
    bring_to(scheduler, loop, engine, evaluation, S.SCORING)
    generation = evaluation_row(engine, evaluation).generation
    assert generation is not None
    with pytest.raises(Conflict, match=f"evaluation {evaluation} needs this job"), transaction(engine) as conn:
        delete(conn, DEFAULT_TENANT, generation.id)
    finish(scheduler, loop, engine, evaluation)
    with transaction(engine) as conn:
        delete(conn, DEFAULT_TENANT, generation.id)
    row = evaluation_row(engine, evaluation)
    assert (row.state, row.generation, len(row.reports)) == (S.DONE, None, 3)


# --- cancel ---


@pytest.mark.parametrize("state", [S.PLANNED, S.GENERATING, S.SCORING])
def test_cancelling_an_evaluation_cancels_the_job_that_runs_for_it(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, folder_store: FolderStore, state: EvaluationState
) -> None:
    evaluation = new_evaluation(engine)
    bring_to(scheduler, loop, engine, evaluation, state)
    with transaction(engine) as conn:
        row = cancel_evaluation(conn, DEFAULT_TENANT, evaluation)
    assert (row.state, row.reason) == (S.CANCELLED, "cancelled by operator")
    jobs = {S.PLANNED: [], S.GENERATING: [row.generation], S.SCORING: [row.scoring]}[state]
    assert [job.state for job in jobs if job] == [JobState.CANCELLED] * len(jobs)
    finish(scheduler, loop, engine, evaluation)
    assert state_of(engine, evaluation) is S.CANCELLED
    assert history(engine, evaluation)[-1] == "cancelled"
    collect_garbage(engine, folder_store)
    assert audit(engine, folder_store) == []
    with transaction(engine) as conn:
        assert audit_tables(conn) == []


def test_cancelling_one_that_is_over_changes_nothing(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop
) -> None:
    evaluation = new_evaluation(engine)
    finish(scheduler, loop, engine, evaluation)
    with transaction(engine) as conn:
        assert cancel_evaluation(conn, DEFAULT_TENANT, evaluation).state is S.DONE


def test_an_evaluation_that_is_being_measured_can_be_cancelled(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator, folder_store: FolderStore
) -> None:
    judge.seconds = 300.0
    evaluation = new_evaluation(engine)
    bring_to(scheduler, loop, engine, evaluation, S.SCORING)
    thread = threading.Thread(target=loop.run)
    thread.start()
    wait(lambda: bool(judge.seen))
    with transaction(engine) as conn:
        cancel_evaluation(conn, DEFAULT_TENANT, evaluation)
    thread.join(60.0)
    assert not thread.is_alive()
    assert state_of(engine, evaluation) is S.CANCELLED
    assert audit(engine, folder_store) == []
