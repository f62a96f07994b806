"""A small trained evaluator and the data that it was trained on, for the files that only look at them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from marey.bundles import Bundle
from marey.data.prepared import PreparedData
from marey.evaluator.assembly import assemble
from marey.evaluator.config import TINY
from marey.evaluator.reference import RealClips
from marey.evaluator.tmr import TMREvaluator
from marey.evaluator.train import train_stage
from marey.training.budget import Budget
from marey.training.staging import TrainOptions
from tests.support.prepared import write_prepared
from tests.support.texts import pipelines_share_parts

ACTS = tuple(f"{verb} {place}" for verb in ("walks", "runs", "waves", "bows") for place in ("here", "there", "away"))


@pytest.fixture(autouse=True, scope="module")
def _shared_parts() -> Iterator[None]:
    with pipelines_share_parts():
        yield


@pytest.fixture(scope="package")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    return PreparedData.open(write_prepared(tmp_path_factory.mktemp("scored") / "prepared", 240, ACTS))


@pytest.fixture(scope="package")
def bundle(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    run = tmp_path_factory.mktemp("scored") / "run"
    train_stage("tmr", TrainOptions(prepared.path, run, TINY, Budget(steps=3), device="cpu", bf16=False, quiet=True))
    assemble(prepared.path, run, run / "judge", TINY)
    return Bundle.open(run / "judge")


@pytest.fixture(scope="package")
def evaluator(bundle: Bundle) -> TMREvaluator:
    return TMREvaluator.load(bundle, device="cpu")


@pytest.fixture(scope="package")
def real(bundle: Bundle) -> RealClips:
    return RealClips.of(bundle)
