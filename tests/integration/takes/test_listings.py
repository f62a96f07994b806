"""Listings are told to their end: into a pipe goes every line, and who wants fewer hears that there are more."""

from __future__ import annotations

import pytest

from marey.cli import console
from tests.support.command import Command
from tests.support.live_api import LiveApi

MOTIONS = console.PAGE + 50


@pytest.fixture(scope="module")
def job(api: LiveApi) -> str:
    """More motions than a page of the API holds."""
    with api.client() as client:
        prompts = [{"prompt": f"a person walks {n} steps", "tags": ["shot=010"], "variants": 50} for n in range(21)]
        job = client.submit(prompts, name="many")["id"]
        api.work()
    return job


def test_motions_are_listed_over_all_pages_so_that_a_pipe_gets_every_one(marey: Command, job: str) -> None:
    for choice in (("--job", job), ("--review", "new", "--tag", "shot=010")):
        ran = marey("motions", "list", *choice).ok()
        ids = [line.partition("\t")[0] for line in ran.out.splitlines()]
        assert (len(ids), len(set(ids)), ran.err) == (MOTIONS, MOTIONS, "")
    assert len(marey("motions", "list", "--json").ok().lines) == MOTIONS


@pytest.mark.parametrize("limit", [3, MOTIONS - 1])
def test_a_limit_shows_fewer_and_says_that_there_are_more(marey: Command, job: str, limit: int) -> None:
    ran = marey("motions", "list", "--job", job, "--limit", limit).ok()
    assert len(ran.out.splitlines()) == limit
    assert f"Showing the first {limit}; use --limit to see more." in ran.err


@pytest.mark.parametrize("limit", [MOTIONS, MOTIONS + 1])
def test_a_limit_that_everything_fits_into_says_nothing(marey: Command, job: str, limit: int) -> None:
    ran = marey("motions", "list", "--job", job, "--limit", limit).ok()
    assert (len(ran.out.splitlines()), ran.err) == (MOTIONS, "")


def test_jobs_are_listed_to_the_end_too(marey: Command, api: LiveApi, job: str) -> None:
    with api.client() as client:
        made = [client.submit([{"prompt": "a person bows"}])["id"] for _ in range(60)]
    ran = marey("jobs", "list").ok()
    assert [line.split("\t")[0] for line in ran.out.splitlines()] == [*reversed(made), job]
    ran = marey("jobs", "list", "--limit", 2, "--json").ok()
    assert [line["id"] for line in ran.lines] == made[:-3:-1]
    assert "Showing the first 2; use --limit to see more." in ran.err
