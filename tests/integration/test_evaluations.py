"""Evaluations from planned to done: scheduler, real handlers in a real loop, real Postgres and store."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from uuid import UUID

import pytest
import sqlalchemy as sa

from services.scheduler import evaluations as steps
from services.scheduler.evaluations import Evaluations
from shared.errors import Conflict, InvalidInput, NotFound, Unreachable
from shared.evaluation_prompts import EvaluationPrompt
from shared.jobs import (
    DEFAULT_TENANT,
    AssetDigest,
    EvaluationRow,
    EvaluationState,
    JobState,
    NewScore,
    begin_assets,
    cancel,
    cancel_evaluation,
    claim,
    collect_garbage,
    commit_score,
    delete,
    evaluation_events,
    get_evaluation,
    get_job,
    list_evaluations,
    list_items,
    move_evaluation,
    retry,
    schema,
    sweep,
    transaction,
)
from shared.jobs.states import EVALUATION_TRANSITIONS
from shared.settings import Settings
from shared.storage import FolderStore
from tests.servers.audit import audit as audit_tables
from tests.servers.jobs import let_expire
from tests.support.evaluations import (
    CLIPS,
    GENERATOR,
    JUDGE,
    PROMPTS,
    ToyEvaluator,
    ToyTexts,
    evaluation_row,
    models_of,
    new_evaluation,
    state_of,
    write_evaluator,
    write_generator,
)
from tests.support.runtime import Loop
from tests.support.toy import ToyHandler
from tests.support.toy_jobs import audit

S = EvaluationState


@pytest.fixture
def config(tmp_path: Path) -> Settings:
    return models_of(tmp_path)


@pytest.fixture
def scheduler(engine: sa.Engine, config: Settings) -> Evaluations:
    return Evaluations(engine, config)


@pytest.fixture
def judge() -> ToyEvaluator:
    return ToyEvaluator()


@pytest.fixture
def loop(engine: sa.Engine, folder_store: FolderStore, judge: ToyEvaluator) -> Iterator[Loop]:
    """One child that serves prompts, motions and evaluations."""
    made = Loop(engine, folder_store, ToyTexts(), ToyHandler(), judge)
    yield made
    made.close()


def wait(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "not in time"
        time.sleep(0.02)


def work(loop: Loop) -> None:
    """Do all there is: what a stage writes down at its end may be claimed by the next drain alone."""
    while loop.run():
        pass


def bring_to(scheduler: Evaluations, loop: Loop, engine: sa.Engine, evaluation: UUID, state: EvaluationState) -> None:
    """Take an evaluation to a state by what the scheduler and workers do."""
    for _ in range(6):
        if state_of(engine, evaluation) is state:
            return
        scheduler.round()
        if state_of(engine, evaluation) is not state:
            work(loop)
    assert state_of(engine, evaluation) is state


def finish(scheduler: Evaluations, loop: Loop, engine: sa.Engine, evaluation: UUID) -> EvaluationRow:
    """Let everybody work until it is over."""
    for _ in range(3):
        scheduler.round()
        work(loop)
    scheduler.round()
    return evaluation_row(engine, evaluation)


def history(engine: sa.Engine, evaluation: UUID) -> list[str]:
    with transaction(engine) as conn:
        return [str(event.state) for event in evaluation_events(conn, evaluation)]


def jobs_there(engine: sa.Engine) -> int:
    with transaction(engine) as conn:
        return conn.execute(sa.select(sa.func.count()).select_from(schema.job)).scalar_one()


def failing(count: int, total: int) -> list[EvaluationPrompt]:
    """So many prompts, of which some cannot be made."""
    return [EvaluationPrompt(f"{'refuse' if n < count else 'walk'} {n} steps") for n in range(total)]


# --- the whole life ---


def test_an_evaluation_is_generated_in_the_background_then_scored_and_reported(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator, folder_store: FolderStore
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


def test_the_evaluator_sees_every_motion_in_input_order_with_what_was_expected(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
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
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine, None))
    assert (row.state, row.request.source, row.prompt_count) == (S.DONE, "test", 3)
    assert [(i.prompt, i.expected, i.seconds) for i in judge.seen[0].items] == [
        ("walk", "walk", 3.0), ("walk and wave", "walk then wave left", 9.8), ("walk as a guide", None, 0.8),
    ]  # fmt: skip


def test_motions_that_were_not_made_are_told_to_the_evaluator(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine, failing(1, 100)))  # just 1 %
    assert (row.state, row.summary and row.summary["made"]) == (S.DONE, 99.0)
    (refused,) = [item for item in judge.seen[0].items if item.npz is None]
    assert refused.problem is not None
    assert (refused.index, str(refused.state), refused.problem.message) == (0, "failed", "this cannot be danced")
    with pytest.raises(NotFound, match="no motion"):
        judge.seen[0].npz(refused)


def test_more_than_one_percent_of_failed_motions_fail_the_report(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
) -> None:
    row = finish(scheduler, loop, engine, new_evaluation(engine, failing(2, 100)))
    assert row.state is S.FAILED
    assert row.reason.startswith("2 of 100 motions were not made, 2.0% where 1% may be")
    assert row.reason.endswith("the first: this cannot be danced")
    assert (row.summary, row.reports, judge.seen) == (None, (), [])


# --- what it is compared with ---


def test_a_run_is_compared_with_the_last_of_the_same_model_prompts_and_evaluator(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator, config: Settings
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


def test_a_pinned_baseline_stays_the_one_to_compare_with(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
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
    assert [run.id for run in score.history] == [first, second]


@pytest.mark.parametrize("what", ["prompts", "evaluator", "state"])
def test_a_baseline_of_other_prompts_or_evaluator_or_without_numbers_is_refused(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, config: Settings, what: str
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


def step(scheduler: Evaluations, engine: sa.Engine, evaluation: UUID) -> EvaluationRow:
    """One step of this evaluation alone."""
    scheduler._step(evaluation)
    return evaluation_row(engine, evaluation)


# --- what goes wrong ---


def test_a_deleted_bundle_fails_the_evaluation_with_the_reason_and_submits_nothing(
    engine: sa.Engine, scheduler: Evaluations
) -> None:
    evaluation = new_evaluation(engine, bundle="gone")
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert row.state is S.FAILED
    assert "there is no model or bundle named 'gone'" in row.reason
    assert jobs_there(engine) == 0


def test_a_bundle_that_was_replaced_since_is_not_measured_in_place_of_it(
    engine: sa.Engine, scheduler: Evaluations, config: Settings
) -> None:
    evaluation = new_evaluation(engine, bundle=f"{GENERATOR}@{'0' * 12}")
    scheduler.round()
    assert "not 000000000000" in evaluation_row(engine, evaluation).reason


def test_lengths_that_the_bundle_cannot_make_fail_the_evaluation_before_anything_is_made(
    engine: sa.Engine, scheduler: Evaluations
) -> None:
    evaluation = new_evaluation(engine, [*PROMPTS, EvaluationPrompt("walk far", 30.0)])
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, jobs_there(engine)) == (S.FAILED, 0)
    assert "1 prompts cannot be made; the first: line 4: seconds: 30 is outside 0.8 to 9.8" in row.reason


def test_an_evaluator_of_another_skeleton_is_refused_before_anything_is_made(
    engine: sa.Engine, scheduler: Evaluations, config: Settings
) -> None:
    write_evaluator(config.models, "judge-of-hands", skeleton="hands")
    evaluation = new_evaluation(engine, evaluator="judge-of-hands")
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, jobs_there(engine)) == (S.FAILED, 0)
    assert "measures motions of the skeleton hands, not of humanml3d" in row.reason


def test_an_evaluator_that_refuses_fails_the_evaluation_with_its_message(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
) -> None:
    judge.problems = [InvalidInput("the motions are of another skeleton")]
    row = finish(scheduler, loop, engine, new_evaluation(engine))
    assert row.state is S.FAILED
    assert "the motions are of another skeleton" in row.reason
    assert row.reports == ()


def test_a_bug_of_the_evaluator_is_tried_again(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
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
    engine: sa.Engine, scheduler: Evaluations, loop: Loop
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
    engine: sa.Engine, scheduler: Evaluations, loop: Loop
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
    engine: sa.Engine, scheduler: Evaluations, loop: Loop
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
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, folder_store: FolderStore, state: EvaluationState
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


def test_cancelling_one_that_is_over_changes_nothing(engine: sa.Engine, scheduler: Evaluations, loop: Loop) -> None:
    evaluation = new_evaluation(engine)
    finish(scheduler, loop, engine, evaluation)
    with transaction(engine) as conn:
        assert cancel_evaluation(conn, DEFAULT_TENANT, evaluation).state is S.DONE


def test_an_evaluation_that_is_being_measured_can_be_cancelled(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator, folder_store: FolderStore
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


# --- kills and races ---


def test_a_scheduler_that_dies_in_the_middle_of_a_step_leaves_nothing_and_the_next_does_it_once(
    engine: sa.Engine, config: Settings, scheduler: Evaluations, loop: Loop, monkeypatch: pytest.MonkeyPatch
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
                Evaluations(engine, config).round()
        assert (state_of(engine, evaluation), jobs_there(engine)) == (state, jobs)
    assert finish(Evaluations(engine, config), loop, engine, evaluation).state is S.DONE
    assert jobs_there(engine) == 2


def test_many_schedulers_at_once_take_each_step_once(
    engine: sa.Engine, config: Settings, loop: Loop, folder_store: FolderStore
) -> None:
    evaluations = [new_evaluation(engine) for _ in range(4)]
    for _ in range(4):
        at_once(*(Evaluations(engine, config).round for _ in range(4)))
        work(loop)
    assert {state_of(engine, each) for each in evaluations} == {S.DONE}
    assert jobs_there(engine) == 8
    assert audit(engine, folder_store) == []


def at_once(*actions: Callable[[], None]) -> None:
    errors: list[BaseException] = []
    barrier = threading.Barrier(len(actions))

    def act(action: Callable[[], None]) -> None:
        barrier.wait()
        try:
            action()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=act, args=(action,)) for action in actions]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []


def test_a_worker_that_dies_while_it_measures_is_followed_by_another(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
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
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shared.runtime.loop.OUTAGE_PAUSE", 0.01)
    judge.problems = [Unreachable("the store is away")]
    evaluation = new_evaluation(engine)
    row = finish(scheduler, loop, engine, evaluation)
    assert row.state is S.DONE
    assert row.scoring is not None
    with transaction(engine) as conn:
        (item,) = list_items(conn, DEFAULT_TENANT, row.scoring.id).rows
    assert item.attempts == 0


def test_a_score_for_an_evaluation_that_is_over_writes_nothing_and_does_not_go_round(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, judge: ToyEvaluator
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


def test_one_evaluation_that_breaks_the_scheduler_holds_up_no_other(engine: sa.Engine, scheduler: Evaluations) -> None:
    broken, good = new_evaluation(engine), new_evaluation(engine)
    with transaction(engine) as conn:  # as if an older version had written it
        conn.execute(sa.text("UPDATE evaluation SET request = '{}' WHERE id = :id"), {"id": broken})
    scheduler.round()
    assert state_of(engine, good) is S.GENERATING


def test_a_broken_evaluators_bundle_fails_the_evaluation(
    engine: sa.Engine, scheduler: Evaluations, config: Settings
) -> None:
    write_evaluator(config.models, "broken", clips=[{**CLIPS[0], "acts": 3}, CLIPS[1]])
    evaluation = new_evaluation(engine, None, evaluator="broken")
    scheduler.round()
    row = evaluation_row(engine, evaluation)
    assert (row.state, "its captions cannot be read" in row.reason) == (S.FAILED, True)


# --- tables ---


def test_reports_are_in_use_and_the_collector_leaves_them(
    engine: sa.Engine, scheduler: Evaluations, loop: Loop, folder_store: FolderStore
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
    table = schema.evaluation
    conn.execute(sa.update(table).where(table.c.id == evaluation).values(state=state, **values))


def test_an_evaluation_begins_planned(engine: sa.Engine) -> None:
    new_evaluation(engine)
    with engine.connect() as conn:
        row = dict(conn.execute(sa.select(schema.evaluation)).mappings().one())
        row |= {"id": UUID(int=1), "state": "failed", "finished_at": row["created_at"]}
        with pytest.raises(sa.exc.DBAPIError, match="an evaluation begins planned, not failed"):
            conn.execute(sa.insert(schema.evaluation).values(row))


def test_a_foreign_tenant_sees_and_changes_nothing(engine: sa.Engine) -> None:
    evaluation = new_evaluation(engine)
    with transaction(engine) as conn:
        conn.execute(sa.insert(schema.tenant).values(id="other"))
    with transaction(engine) as conn:
        assert list_evaluations(conn, "other").rows == ()
        for act in (get_evaluation, cancel_evaluation):
            with pytest.raises(NotFound):
                act(conn, "other", evaluation)
    assert state_of(engine, evaluation) is S.PLANNED
