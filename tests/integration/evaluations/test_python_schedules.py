"""`client.schedules` and `client.models` against a real API with a scheduler and a worker beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from marey.client import Client, InvalidInput, InvalidItems, NotFound
from tests.support.evaluations import GENERATOR
from tests.support.live_evaluations import Studio

MONDAYS = "0 3 * * 1"


@pytest.fixture
def client(place: Studio) -> Iterator[Client]:
    with Client(place.api.url, place.api.key) as client:
        yield client


def test_a_schedule_is_made_changed_run_and_deleted(place: Studio, client: Client) -> None:
    made = client.schedules.create(
        MONDAYS, GENERATOR, time_zone="Europe/Berlin", name="weekly", prompts=["walk ahead", "walk and wave"], seed=3
    )
    assert (made.cron, made.time_zone, made.name, made.paused, made.prompts) == (
        MONDAYS, "Europe/Berlin", "weekly", False, 2,
    )  # fmt: skip
    assert (made.request.bundle, made.request.source, made.request.seed) == (GENERATOR, "prompts", 3)
    assert made.next is not None
    assert made.next.weekday() == 0
    assert [each.id for each in client.schedules.list(limit=1)] == [made.id]
    paused = client.schedules.pause(made)
    assert (paused.paused, paused.next) == (True, None)
    resumed = client.schedules.resume(made.id)
    assert (resumed.paused, resumed.next) == (False, made.next)
    changed = client.schedules.update(made, cron="0 4 * * 2", name="other")
    assert (changed.cron, changed.name, changed.time_zone) == ("0 4 * * 2", "other", "Europe/Berlin")
    run = client.schedules.run(made)
    place.work()
    assert client.evaluations.wait(run, timeout=60).state == "done"
    (listed,) = client.schedules.runs(made, limit=5)
    assert (listed.id, listed.schedule, listed.name) == (run.id, made.id, "other")
    found = client.schedules.get(made)
    assert (found.last, found.last_state, found.last_regressed) == (run.id, "done", None)
    client.schedules.delete(made)
    with pytest.raises(NotFound):
        client.schedules.get(made)
    assert client.evaluations.get(run).schedule is None


def test_a_baseline_and_the_split_go_into_the_request(place: Studio, client: Client) -> None:
    prompts = ["walk ahead", "walk and wave"]
    before = client.evaluations.run(GENERATOR, prompts=prompts)
    place.work()
    made = client.schedules.create(MONDAYS, GENERATOR, prompts=prompts, baseline=before, repeats=2)
    assert (made.request.baseline, made.request.repeats, made.request.source) == (before.id, 2, "prompts")
    client.schedules.delete(made)
    made = client.schedules.create(MONDAYS, GENERATOR, split="test")
    assert (made.request.baseline, made.request.source) == (None, "test")
    client.schedules.delete(made)


def test_what_cannot_be_scheduled_is_refused_with_its_lines(client: Client, tmp_path: Path) -> None:
    for cron, zone in (("0 3 * *", "UTC"), (MONDAYS, "Mars/Olympus")):
        with pytest.raises(InvalidInput):
            client.schedules.create(cron, GENERATOR, time_zone=zone)
    path = tmp_path / "studio.csv"
    path.write_text("prompt,seconds\n\nwalk ahead,40\nwalk and wave,2\n")
    with pytest.raises(InvalidItems) as told:
        client.schedules.create(MONDAYS, GENERATOR, prompts=path)
    assert told.value.where == str(path)
    assert [(problem.line, problem.field) for problem in told.value.problems] == [(3, "seconds")]
    assert list(client.schedules.list()) == []


def test_broken_bundles_stand_beside_the_models(place: Studio, client: Client) -> None:
    broken = place.config.models / "broken"
    broken.mkdir()
    (broken / "manifest.json").write_text("{")
    catalogue = client.models.catalogue()
    assert GENERATOR in [model.name for model in catalogue.items]
    assert [(each.name, each.reason.startswith("manifest.json")) for each in catalogue.broken] == [("broken", True)]
    assert client.models.get(GENERATOR) in list(client.models.list())
    with pytest.raises(NotFound):
        client.models.get("gone")
