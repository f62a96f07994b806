"""The previous release and this one on the same rows, as server, worker and client of each other.

Each is a wheel in an environment of its own, to which this checkout is closed. `make test` holds the same by parts:
statements (`test_statements.py`), columns (`test_expanding.py`) and routes (`tests/contracts`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx2
import pytest

from marey.bundles import Bundle
from tests.support.marey import TINY
from tests.support.releases import Release, earlier_release, installed_release, wait_until
from tests.support.wheels import make_environment, this_wheel

pytestmark = pytest.mark.slow
PREVIOUS = "26b0fe97"
"""The last commit in which the code was three packages."""
FORMAT_1 = "03315bd6"
"""A release that reads bundles of format 1 alone."""
COUNT = 3


def new_key(release: Release) -> str:
    """Migrate the database to a release, and make a key."""
    release.run("admin", "migrate")
    made = release.run("admin", "keys", "create", "tester", "--scope", "read", "--scope", "submit", "--json")
    return json.loads(made)["secret"]


def submit(http: httpx2.Client, word: str) -> str:
    items = [{"prompt": f"a person walks {n} steps, {word}", "seconds": 2, "seed": n} for n in range(COUNT)]
    answer = http.post("/v1/jobs", json={"items": items})
    assert answer.status_code in (200, 201, 202), answer.text
    return answer.json()["id"]


def job(http: httpx2.Client, job_id: str) -> dict[str, Any]:
    answer = http.get(f"/v1/jobs/{job_id}")
    assert answer.status_code == 200, answer.text
    return answer.json()


def bundles_of(http: httpx2.Client, job_id: str) -> set[str]:
    found = http.get(f"/v1/jobs/{job_id}/items", params={"limit": 100}).json()["items"]
    assert len(found) == COUNT
    return {item["bundle"] for item in found}


def with_key(release: Release, key: str) -> Release:
    return Release(release.command, {**release.environment, "MAREY_KEY": key}, release.folder)


def fetched_by(client: Release, job_id: str, folder: Path) -> list[str]:
    """Names of the motions of a job that a client fetches with their manifest."""
    client.run("fetch", job_id, "-o", str(folder))
    return sorted(path.name for path in folder.rglob("*.bvh"))


@pytest.mark.parametrize("commit", [PREVIOUS, FORMAT_1])
def test_each_release_finishes_what_the_other_has_queued(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, models: Path, values: Mapping[str, str], commit: str
) -> None:
    previous = earlier_release(commit, tmp_path / "previous", values)
    made = make_environment(tmp_path / "current", [this_wheel(tmp_path_factory)], borrow=True)
    current = installed_release(made, values, tmp_path)
    log = tmp_path / "log"
    reference = Bundle.open(models / TINY).reference
    key = new_key(previous)
    previous, current = with_key(previous, key), with_key(current, key)
    with previous.api(log, key) as http:
        queued = submit(http, "old")
        by_client = json.loads(current.run("submit", "a person waves", "--seed", "7", "--json"))["id"]
        assert job(http, by_client)["state"] == "queued"

    current.run("admin", "migrate")
    with current.api(log, key) as http, current.running(log, "scheduler"):
        assert job(http, queued)["counters"].get("succeeded", 0) == 0
        with current.running(log, "worker", "hgm3+text"):
            wait_until(lambda: job(http, queued)["counters"].get("succeeded") == COUNT, log)
            wait_until(lambda: job(http, by_client)["state"] == "succeeded", log)
        assert bundles_of(http, queued) == {reference}

        newer = submit(http, "new")
        with current.running(log, "worker", "text"), previous.running(log, "worker", "hgm3"):
            wait_until(lambda: job(http, newer)["counters"].get("succeeded") == COUNT, log)
        assert bundles_of(http, newer) == {reference}
        theirs, ours = (fetched_by(client, newer, tmp_path / name) for name, client in
                        (("theirs", previous), ("ours", current)))  # fmt: skip
        assert theirs == ours
        assert len(ours) == COUNT


def test_a_bundle_of_format_2_is_refused_by_a_release_that_reads_format_1_and_named(
    tmp_path: Path, models: Path, values: Mapping[str, str]
) -> None:
    file = models / TINY / "manifest.json"
    document = json.loads(file.read_text())
    file.write_text(json.dumps({**document, "format": 2}))
    try:
        assert Bundle.open(file.parent).manifest.format == 2
        previous = earlier_release(FORMAT_1, tmp_path / "previous", values)
        with pytest.raises(AssertionError, match="is not a manifest this version reads: format"):
            previous.run("generate", "a person waves", "--model", TINY, "-o", str(tmp_path / "x.bvh"))
    finally:
        file.write_text(json.dumps(document))
