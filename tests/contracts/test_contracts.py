"""Each surface equals what is recorded. A wanted change: `python -m tests.contracts`, and say so in the change log."""

from __future__ import annotations

import json
from multiprocessing import get_context
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sqlalchemy as sa

from marey.registry import model_names
from tests.contracts.__main__ import RECORDED, file_of
from tests.contracts.motions import motion, processor
from tests.contracts.story import events
from tests.contracts.surfaces import SURFACES, database, of_model

HINT = "if this change is wanted: `python -m tests.contracts`"


def recorded(name: str) -> Any:
    return json.loads((RECORDED / f"{name}.json").read_text(encoding="utf-8"))


def recorded_of(model: str) -> Any:
    return json.loads(file_of(model).read_text(encoding="utf-8"))


MOTIONS = [(model, name) for model in model_names() for name in recorded_of(model)["motions"]]


def differences(recorded: Any, found: Any, place: str = "") -> list[str]:
    """Where two JSON values differ, as dotted places."""
    if isinstance(recorded, dict) and isinstance(found, dict):
        return [
            line
            for key in sorted(recorded.keys() | found.keys())
            for line in (
                differences(recorded[key], found[key], f"{place}.{key}")
                if key in recorded and key in found
                else [f"{place}.{key}: {'gone' if key in recorded else 'new'}"]
            )
        ]
    return [] if recorded == found else [f"{place}: {str(recorded)[:200]} -> {str(found)[:200]}"]


@pytest.mark.parametrize("name", sorted(SURFACES))
def test_a_surface_is_as_recorded(name: str) -> None:
    found = json.loads(json.dumps(SURFACES[name]()))
    assert differences(recorded(name), found) == [], HINT


def test_the_schema_is_as_recorded(database_url: str, pg_dump: Path) -> None:
    assert database(pg_dump, database_url) == recorded("database"), HINT


def test_events_and_webhooks_are_as_recorded(engine: sa.Engine) -> None:
    assert differences(recorded("events"), json.loads(json.dumps(events(engine)))) == [], HINT


@pytest.mark.parametrize("model", model_names())
def test_the_part_of_a_model_is_as_recorded(model: str) -> None:
    known, found = recorded_of(model), json.loads(json.dumps(of_model(model)))
    assert set(known) == {*found, "motions", "processor"}
    assert set(known["motions"]) == set(found["bundle_tensors"])
    assert differences({name: known[name] for name in found}, found) == [], HINT


@pytest.fixture(scope="module")
def fresh() -> ForkServerContext:
    """Forks of a process that has imported what a motion needs, and computed nothing."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["tests.contracts.motions", "marey.generate.oneshot"])
    return context


@pytest.mark.parametrize(("model", "name"), MOTIONS)
def test_a_motion_of_a_shipped_bundle_is_as_recorded(model: str, name: str, fresh: ForkServerContext) -> None:
    """Bit for bit on the kind of processor it was recorded on; elsewhere its length and its keys.

    There a sum is added in another order, which may draw another token.
    """
    known = recorded_of(model)["motions"][name]
    with fresh.Pool(1) as pool:  # in a process that reads many texts, MiniLM is compiled: other last bits
        found = pool.apply(motion, (name,))
    assert found["frames"] == known["frames"]
    assert found["manifest"] == known["manifest"]
    if recorded_of(model)["processor"] == processor():
        assert (found["npz"], found["bvh"]) == (known["npz"], known["bvh"])
        assert found["joints"] == known["joints"]


def test_what_is_recorded_is_compared() -> None:
    names = {path.stem for path in RECORDED.glob("*.json")}
    assert names == {*SURFACES, "database", "events", "motion"}
    assert all(np.size(recorded(name)) for name in names)
