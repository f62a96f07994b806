"""A scheduler and a worker of evaluations on the test's own database; both move when told."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from marey.core.settings import Settings
from marey.scheduler.evaluations import EvaluationScheduler
from marey.storage import FolderStore
from tests.support.evaluations import ToyEvaluator, models_of
from tests.support.runtime import Loop
from tests.support.toy import ToyHandler, ToyTextHandler


@pytest.fixture
def config(tmp_path: Path) -> Settings:
    return models_of(tmp_path)


@pytest.fixture
def scheduler(engine: sa.Engine, config: Settings) -> EvaluationScheduler:
    return EvaluationScheduler(engine, config)


@pytest.fixture
def judge() -> ToyEvaluator:
    return ToyEvaluator()


@pytest.fixture
def loop(engine: sa.Engine, folder_store: FolderStore, judge: ToyEvaluator) -> Iterator[Loop]:
    """One child that serves prompts, motions and evaluations."""
    made = Loop(engine, folder_store, ToyTextHandler(), ToyHandler(), judge)
    yield made
    made.close()
