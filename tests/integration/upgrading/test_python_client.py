"""The Python client against servers one release older, and the client of an earlier release against this server.

Each earlier release is a wheel in an environment of its own, to which this checkout is closed.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from marey.client import Client
from tests.integration.upgrading.test_previous_release import COUNT, PREVIOUS, new_key
from tests.support.releases import Release, earlier_release, installed_release
from tests.support.wheels import make_environment, this_wheel

pytestmark = pytest.mark.slow
FIRST_CLIENT = "7d0528c"
"""The first commit with `marey.client`."""


@contextlib.contextmanager
def platform(release: Release, log: Path, key: str) -> Iterator[None]:
    """The API, a scheduler and a worker of a release."""
    with release.api(log, key), release.running(log, "scheduler"), release.running(log, "worker", "hgm3+text"):
        yield


def test_the_client_works_with_an_older_server(tmp_path: Path, values: Mapping[str, str]) -> None:
    previous = earlier_release(PREVIOUS, tmp_path / "previous", values)
    key = new_key(previous)
    with platform(previous, tmp_path / "log", key), Client(values["MAREY_SERVER"], key) as client:
        rows = [{"prompt": f"a person walks {n} steps", "seconds": 2, "seed": n} for n in range(COUNT)]
        seen: list[int] = []
        job = client.jobs.submit(rows, name="old server", tags=["shot=1"])
        ended = client.jobs.wait(job, timeout=100, on_progress=lambda now: seen.append(now.done))
        assert (ended.state, ended.counters.succeeded, seen[-1]) == ("succeeded", COUNT, COUNT)
        fetched = client.jobs.fetch(job, tmp_path / "clips", formats=["bvh"])
        assert [each.item.seed for each in fetched] == [0, 1, 2]
        assert all(each.files["bvh"].read_bytes().startswith(b"HIERARCHY") for each in fetched)
        motions = list(client.motions.list(tags=["shot=1"]))
        assert len(motions) == COUNT
        (kept,) = client.motions.keep(motions[0], comment="good")
        assert kept.review is not None
        assert (kept.review.verdict, kept.review.comment) == ("kept", "good")
        assert client.motions.get(kept).metadata["prompt"] == kept.prompt
        assert {model.model for model in client.models.list()} >= {"hgm3"}
        assert client.jobs.get(job).raw["id"] == job.id


def test_an_earlier_client_works_with_this_server(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, values: Mapping[str, str]
) -> None:
    earlier = earlier_release(FIRST_CLIENT, tmp_path / "earlier", values)
    made = make_environment(tmp_path / "current", [this_wheel(tmp_path_factory)], borrow=True)
    current = installed_release(made, values, tmp_path)
    key = new_key(current)
    (tmp_path / "prompts.csv").write_text("prompt,seed,seconds\na person walks,3,2\na person waves,4,2\n")
    with platform(current, tmp_path / "log", key):
        done = subprocess.run(
            [str(Path(earlier.command[0]).with_name("python")), "-c", SCRIPT, "prompts.csv", "clips"],
            cwd=tmp_path, env={**earlier.environment, "MAREY_KEY": key}, capture_output=True, text=True, timeout=120,
            check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert str(tmp_path / "earlier") in found["client"]
    assert (found["state"], found["seeds"]) == ("succeeded", [3, 4])
    assert len(list((tmp_path / "clips").glob("*.bvh"))) == 2


SCRIPT = """
import json, sys
import marey.client
with marey.client.Client() as client:
    job = client.jobs.submit_file(sys.argv[1])
    ended = client.jobs.wait(job, timeout=100)
    fetched = client.jobs.fetch(job, sys.argv[2])
    assert [motion.seed for motion in client.motions.list(job=job)]
    print(json.dumps({"client": marey.client.__file__, "state": ended.state, "seeds": [e.item.seed for e in fetched]}))
"""
