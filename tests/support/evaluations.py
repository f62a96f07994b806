"""Evaluations for tests: bundles that are only looked at, and real handlers that do next to nothing."""

from __future__ import annotations

import dataclasses
import json
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import sqlalchemy as sa

from marey.bundles import BundleWriter, TextSpec
from marey.core.settings import Settings
from marey.db import transaction
from marey.evaluations import (
    EvaluationRequest,
    EvaluationRow,
    EvaluationState,
    MadeItem,
    NewEvaluation,
    create_evaluation,
    evaluation_events,
    get_evaluation,
    store_prompts,
)
from marey.items.evaluation_prompts import EvaluationPrompt
from marey.jobs import EVALUATOR_QUEUE, ClaimedItem, tables
from marey.measures.scores import SCHEMA, VERSION, MotionScore
from marey.runtime.export_types import ExportedFile
from marey.runtime.handler import Batch, BatchControl, Outcome, Scored
from marey.runtime.scoring import ScoreInput
from marey.scheduler.evaluations import EvaluationScheduler
from marey.tenants import DEFAULT_TENANT
from tests.support import toy
from tests.support.runtime import Loop

GENERATOR, JUDGE = "toy-starter", "judge"
CLIPS = [
    {"acts": ["walk"], "sides": [""], "frames": 60, "captions": ["walk", "a person walks"]},
    {"acts": ["walk", "wave"], "sides": ["", "left"], "frames": 196, "captions": ["walk and wave"] * 2},
    {"acts": ["guide"], "sides": ["left"], "frames": 12, "captions": ["walk ahead", "walk on", "walk as a guide"]},
]  # fmt: skip
PROMPTS = (EvaluationPrompt("walk", 2.0, "walk"), EvaluationPrompt("walk away"), EvaluationPrompt("walk on", 3.0))


def write_generator(
    models: Path, name: str = GENERATOR, *, model: str = toy.QUEUE, weight: float = 0.0, licence: str = "MIT"
) -> None:
    """A generator's bundle; another `weight` makes it another exact bundle."""
    with BundleWriter(models / name, overwrite=True) as writer:
        writer.add_part("masked", {"w": np.full(3, weight, np.float32)})
        writer.finish(
            name=name, version="1", kind="generator", model=model, config="tiny", fps=20.0, licence=licence,
            skeleton="humanml3d", layout="humanml3d-263",
            parameters={"min_frames": 16, "max_frames": 196, "inference": {"steps": 10}},
            text=TextSpec(labeller="none", encoder_sha256="0" * 64),
        )  # fmt: skip


def write_evaluator(
    models: Path,
    name: str = JUDGE,
    *,
    clips: Sequence[dict[str, Any]] = CLIPS,
    weight: float = 0.0,
    skeleton: str = "humanml3d",
    layout: str = "humanml3d-263",
    fps: float = 20.0,
    motions: int | None = None,
) -> None:
    """An evaluator's bundle with the captions of these clips, and embeddings of so many motions if it has any."""
    full = [{"id": f"c{n}", "label": "x", "captured": True, **clip} for n, clip in enumerate(clips)]
    with BundleWriter(models / name, overwrite=True) as writer:
        writer.add_part("motion", {"w": np.full(3, weight, np.float32)})
        writer.add_json("reference.json", {"test": full})
        if motions is not None:
            writer.add_part("reference", {"test": np.zeros((motions, 4), np.float16)})
        writer.finish(
            name=name,
            version="1",
            kind="evaluator",
            model="toy",
            config="tiny",
            parameters={},
            fps=fps,
            skeleton=skeleton,
            layout=layout,
            licence="MIT",
        )


def models_of(home: Path) -> Settings:
    """Settings with one generator and one evaluator."""
    models = home / "models"
    write_generator(models)
    write_evaluator(models)
    return Settings(home=home, models=models)


class ToyEvaluator:
    """Counts motions and bytes.

    Attributes:
        seen: what it was given.
        problems: raised, one a call, before it answers.
        forget: motions that it leaves out of its count, which is worse than before.
        timelines: motions count as timelines too; half of the rows of each that does not fail are shown.
    """

    queue = EVALUATOR_QUEUE
    batch_size = 1

    def __init__(self, *problems: Exception, seconds: float = 0.0) -> None:
        self.seen: list[ScoreInput] = []
        self.problems = list(problems)
        self.seconds = seconds
        self.forget = 0
        self.timelines = False

    def load(self, bundle: str) -> None:
        pass

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        return [batch.items]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        score = batch.scoring
        assert score is not None
        self.seen.append(score)
        if self.problems:
            raise self.problems.pop(0)
        (item,) = batch.items
        until = time.monotonic() + self.seconds
        while time.monotonic() < until:
            if item.id in control.dropped():
                return
            control.progress(0, 1)
            time.sleep(0.01)
        made = [each for each in score.items if each.npz is not None]
        read = sum(len(score.npz(each)) for each in made)
        summary = {"made": float(len(made) - self.forget), "bytes": float(read), "fid": None}
        before = score.baseline or score.previous
        regressed = None if before is None else summary["made"] < (before.summary["made"] or 0)
        files = tuple(
            ExportedFile(name, content, media)
            for name, content, media in (
                ("html", f"<p>{len(made)} motions of {score.evaluation}</p>".encode(), "text/html; charset=utf-8"),
                ("json", self._scores(summary, made), "application/json"),
                ("md", f"# {len(made)} motions of {score.evaluation}\n".encode(), "text/markdown; charset=utf-8"),
            )
        )
        yield Scored(item.id, files, summary, regressed, f"{len(made)} motions measured")

    def _scores(self, summary: dict[str, float | None], made: Sequence[MadeItem]) -> bytes:
        """Scores for a comparison: missing motions count as failed."""
        obeyed = [float(number >= self.forget) for number in range(len(made))]
        scores = [
            MotionScore(i.index, i.variant, each, None, each / 2 if self.timelines else None)
            for i, each in zip(made, obeyed, strict=True)
        ]
        rows = [dataclasses.asdict(score) for score in scores]
        return json.dumps({"schema": SCHEMA, "version": VERSION, **summary, "scores": rows}).encode()


def new_evaluation(
    engine: sa.Engine,
    prompts: Sequence[EvaluationPrompt] | None = PROMPTS,
    *,
    bundle: str = GENERATOR,
    evaluator: str | None = None,
    repeats: int = 1,
    baseline: UUID | None = None,
    tenant: str = DEFAULT_TENANT,
    id: UUID | None = None,
) -> UUID:
    """A planned evaluation of these prompts; None = those of the evaluator's bundle."""
    source = "test" if prompts is None else "mine"
    request = EvaluationRequest(bundle, evaluator, source=source, repeats=repeats, seed=7, baseline=baseline)
    with transaction(engine) as conn:
        sha256 = None if prompts is None else store_prompts(conn, tenant, prompts)
        made = create_evaluation(conn, NewEvaluation(tenant, request, sha256, **({} if id is None else {"id": id})))
    assert made is not None
    return made


def evaluation_row(engine: sa.Engine, evaluation: UUID) -> EvaluationRow:
    """The evaluation as it stands."""
    with transaction(engine) as conn:
        return get_evaluation(conn, DEFAULT_TENANT, evaluation)


def state_of(engine: sa.Engine, evaluation: UUID) -> EvaluationState:
    """Where the evaluation stands."""
    return evaluation_row(engine, evaluation).state


# --- moving on ---


def wait(condition: Callable[[], bool], seconds: float = 120.0) -> None:
    """Wait for something that others do."""
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "not in time"
        time.sleep(0.02)


def work(loop: Loop) -> None:
    """Do all there is: what a stage writes down at its end may be claimed by the next drain alone."""
    while loop.run():
        pass


def bring_to(
    scheduler: EvaluationScheduler, loop: Loop, engine: sa.Engine, evaluation: UUID, state: EvaluationState
) -> None:
    """Take an evaluation to a state by what the scheduler and workers do."""
    for _ in range(6):
        if state_of(engine, evaluation) is state:
            return
        scheduler.round()
        if state_of(engine, evaluation) is not state:
            work(loop)
    assert state_of(engine, evaluation) is state


def finish(scheduler: EvaluationScheduler, loop: Loop, engine: sa.Engine, evaluation: UUID) -> EvaluationRow:
    """Let everybody work until it is over."""
    for _ in range(3):
        scheduler.round()
        work(loop)
    scheduler.round()
    return evaluation_row(engine, evaluation)


def history(engine: sa.Engine, evaluation: UUID) -> list[str]:
    """The states it went through."""
    with transaction(engine) as conn:
        return [str(event.state) for event in evaluation_events(conn, evaluation)]


def jobs_there(engine: sa.Engine) -> int:
    """How many jobs there are."""
    with transaction(engine) as conn:
        return conn.execute(sa.select(sa.func.count()).select_from(tables.job)).scalar_one()


def at_once(*actions: Callable[[], None]) -> None:
    """Run these in threads that begin together; none may raise."""
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
