"""Evaluations under kills and races, and what their tables allow."""

from __future__ import annotations

from itertools import product
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.core.errors import InvalidInput, NotFound, Unreachable
from marey.core.settings import Settings
from marey.db import transaction
from marey.evaluations import (
    EvaluationState,
    NewScore,
    cancel_evaluation,
    commit_score,
    get_evaluation,
    list_evaluations,
    lock_evaluation,
    move_evaluation,
)
from marey.evaluations import tables as evaluation_tables
from marey.evaluations.states import EVALUATION_TRANSITIONS
from marey.jobs import (
    AssetDigest,
    JobState,
    NewJob,
    begin_assets,
    claim,
    get_job,
    list_items,
    retry,
    submit,
    sweep,
)
from marey.scheduler import evaluations as steps
from marey.scheduler.evaluations import EvaluationScheduler
from marey.storage import FolderStore
from marey.takes import collect_garbage, delete
from marey.tenants import DEFAULT_TENANT
from marey.tenants import tables as tenant_tables
from tests.servers.jobs import let_expire
from tests.support.evaluations import (
    CLIPS,
    ToyEvaluator,
    at_once,
    bring_to,
    evaluation_row,
    finish,
    jobs_there,
    new_evaluation,
    state_of,
    work,
    write_evaluator,
)
from tests.support.runtime import Loop
from tests.support.toy_jobs import audit

S = EvaluationState


def test_a_scheduler_that_dies_in_the_middle_of_a_step_leaves_nothing_and_the_next_does_it_once(
    engine: sa.Engine, config: Settings, scheduler: EvaluationScheduler, loop: Loop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed after the submit, before the commit: the only place where half of a step could stand."""

    class Killed(BaseException):
        pass

    def die(*_: object, **__: object) -> None:
        raise Killed

    evaluation = new_evaluation(engine)
    for state, jobs in ((S.PLANNED, 0), (S.GENERATING, 1)):
        bring_to(scheduler, loop, engine, evaluation, state)
        work(loop)  # what was asked for so far is made
        with monkeypatch.context() as patch:
            patch.setattr(steps, "move_evaluation", die)
            with pytest.raises(Killed):
                EvaluationScheduler(engine, config).round()
        assert (state_of(engine, evaluation), jobs_there(engine)) == (state, jobs)
    assert finish(EvaluationScheduler(engine, config), loop, engine, evaluation).state is S.DONE
    assert jobs_there(engine) == 2


def test_a_submit_that_is_refused_half_way_leaves_nothing(
    engine: sa.Engine, scheduler: EvaluationScheduler, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(conn: sa.Connection, job: NewJob) -> None:
        submit(conn, job)
        raise InvalidInput("one item too many")

    monkeypatch.setattr(steps, "submit", refuse)
    evaluation = new_evaluation(engine)
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, row.reason, jobs_there(engine)) == (S.FAILED, "it cannot start: one item too many", 0)


def test_an_evaluation_that_another_scheduler_has_in_hand_is_left_alone(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    evaluation = new_evaluation(engine)
    with engine.connect() as other:
        assert lock_evaluation(other, evaluation) is not None
        scheduler.round()
        assert jobs_there(engine) == 0
        other.rollback()
    scheduler.round()
    assert state_of(engine, evaluation) is S.GENERATING


def test_many_schedulers_at_once_take_each_step_once(
    engine: sa.Engine, config: Settings, loop: Loop, folder_store: FolderStore
) -> None:
    evaluations = [new_evaluation(engine) for _ in range(4)]
    for _ in range(4):
        at_once(*(EvaluationScheduler(engine, config).round for _ in range(4)))
        work(loop)
    assert {state_of(engine, each) for each in evaluations} == {S.DONE}
    assert jobs_there(engine) == 8
    assert audit(engine, folder_store) == []


def test_a_worker_that_dies_while_it_measures_is_followed_by_another(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    evaluation = new_evaluation(engine)
    bring_to(scheduler, loop, engine, evaluation, S.SCORING)
    with transaction(engine) as conn:
        dead = claim(conn, "evaluator", "dead", 1)
        assert dead is not None
    let_expire(engine, dead.lease_token)
    sweep(engine)
    assert finish(scheduler, loop, engine, evaluation).state is S.DONE
    with transaction(engine) as conn:  # it was not dead after all, and comes too late
        late = NewScore(dead.items[0].id, {"md": AssetDigest("0" * 64, 1)}, {"made": 1e9}, True, "late")
        assert commit_score(conn, dead.lease_token, late).items == ()
    row = evaluation_row(engine, evaluation)
    assert (row.reason, row.regressed) == ("3 motions measured", None)


def test_an_outage_of_the_store_while_motions_are_read_costs_nothing(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("marey.runtime.loop.OUTAGE_PAUSE", 0.01)
    judge.problems = [Unreachable("the store is away")]
    evaluation = new_evaluation(engine)
    row = finish(scheduler, loop, engine, evaluation)
    assert row.state is S.DONE
    assert row.scoring is not None
    with transaction(engine) as conn:
        (item,) = list_items(conn, DEFAULT_TENANT, row.scoring.id).rows
    assert item.attempts == 0


def test_a_score_for_an_evaluation_that_is_over_writes_nothing_and_does_not_go_round(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, judge: ToyEvaluator
) -> None:
    """An operator tries the failed item of a failed evaluation again."""
    judge.problems = [InvalidInput("no")]
    evaluation = new_evaluation(engine)
    row = finish(scheduler, loop, engine, evaluation)
    assert row.scoring is not None
    with transaction(engine) as conn:
        retry(conn, DEFAULT_TENANT, row.scoring.id)
    loop.run()
    with transaction(engine) as conn:
        (item,) = list_items(conn, DEFAULT_TENANT, row.scoring.id).rows
    assert str(item.state) == "failed"
    assert item.problem is not None
    assert "it is failed, not scoring" in item.problem.message
    with transaction(engine) as conn:
        retry(conn, DEFAULT_TENANT, row.scoring.id)
        claimed = claim(conn, "evaluator", "w", 1)
        assert claimed is not None
        begin_assets(conn, claimed.lease_token, [AssetDigest("0" * 64, 1)])
        score = NewScore(claimed.items[0].id, {"md": AssetDigest("0" * 64, 1)}, {}, None, "done")
        assert commit_score(conn, claimed.lease_token, score).items == (claimed.items[0].id,)
        assert get_job(conn, DEFAULT_TENANT, row.scoring.id).state is JobState.FAILED
    assert state_of(engine, evaluation) is S.FAILED


def test_one_evaluation_that_breaks_the_scheduler_holds_up_no_other(
    engine: sa.Engine, scheduler: EvaluationScheduler
) -> None:
    broken, good = new_evaluation(engine), new_evaluation(engine)
    with transaction(engine) as conn:  # as if an older version had written it
        conn.execute(sa.text("UPDATE evaluation SET request = '{}' WHERE id = :id"), {"id": broken})
    scheduler.round()
    assert state_of(engine, good) is S.GENERATING


def test_a_broken_evaluators_bundle_fails_the_evaluation(
    engine: sa.Engine, scheduler: EvaluationScheduler, config: Settings
) -> None:
    write_evaluator(config.models, "broken", clips=[{**CLIPS[0], "acts": 3}, CLIPS[1]])
    evaluation = new_evaluation(engine, None, evaluator="broken")
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, "the captions of broken cannot be read" in row.reason) == (S.FAILED, True)


# --- tables ---


def test_reports_are_in_use_and_the_collector_leaves_them(
    engine: sa.Engine, scheduler: EvaluationScheduler, loop: Loop, folder_store: FolderStore
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine))
    assert row.generation is not None
    before = set(folder_store.keys())
    assert collect_garbage(engine, folder_store).rows == 0
    with transaction(engine) as conn:
        delete(conn, DEFAULT_TENANT, row.generation.id)
    assert collect_garbage(engine, folder_store).rows == 6  # three motions of two files
    kept = {f"t/default/{file.sha256[:2]}/{file.sha256}" for file in row.reports}
    assert set(folder_store.keys()) == kept
    assert kept < before


def test_the_database_allows_the_transitions_of_the_code_and_no_other(engine: sa.Engine) -> None:
    ways = {
        S.PLANNED: [],
        S.GENERATING: [S.GENERATING],
        S.SCORING: [S.GENERATING, S.SCORING],
        S.DONE: [S.GENERATING, S.SCORING, S.DONE],
        S.FAILED: [S.FAILED],
        S.CANCELLED: [S.CANCELLED],
    }
    evaluation = new_evaluation(engine)
    for before, after in product(S, S):
        if before is after:
            continue
        with engine.connect() as conn:
            for state in ways[before]:
                put(conn, evaluation, state)
            row = get_evaluation(conn, DEFAULT_TENANT, evaluation)
            if after in EVALUATION_TRANSITIONS[before]:
                put(conn, evaluation, after)
            else:
                with pytest.raises(ValueError, match=f"from {before} to {after}"):
                    move_evaluation(conn, row, after, "no")
                with pytest.raises(sa.exc.DBAPIError, match=f"an evaluation may not go from {before} to {after}"):
                    put(conn, evaluation, after)
            conn.rollback()


def put(conn: sa.Connection, evaluation: UUID, state: EvaluationState) -> None:
    """Set a state and what must go with it, so that the transition alone decides."""
    over = state in (S.DONE, S.FAILED, S.CANCELLED)
    values = {"finished_at": sa.func.now() if over else None, "summary": {} if state is S.DONE else sa.null()}
    table = evaluation_tables.evaluation
    conn.execute(sa.update(table).where(table.c.id == evaluation).values(state=state, **values))


def test_an_evaluation_begins_planned(engine: sa.Engine) -> None:
    new_evaluation(engine)
    with engine.connect() as conn:
        row = dict(conn.execute(sa.select(evaluation_tables.evaluation)).mappings().one())
        row |= {"id": UUID(int=1), "state": "failed", "finished_at": row["created_at"]}
        with pytest.raises(sa.exc.DBAPIError, match="an evaluation begins planned, not failed"):
            conn.execute(sa.insert(evaluation_tables.evaluation).values(row))


def test_a_foreign_tenant_sees_and_changes_nothing(engine: sa.Engine) -> None:
    evaluation = new_evaluation(engine)
    with transaction(engine) as conn:
        conn.execute(sa.insert(tenant_tables.tenant).values(id="other"))
    with transaction(engine) as conn:
        assert list_evaluations(conn, "other").rows == ()
        for act in (get_evaluation, cancel_evaluation):
            with pytest.raises(NotFound):
                act(conn, "other", evaluation)
    assert state_of(engine, evaluation) is S.PLANNED
