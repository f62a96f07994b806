"""Commands take what a person can type, say what they met, and never guess; tables of 80 columns keep ids whole."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path
from uuid import uuid4

import pytest

from marey.db import transaction
from marey.tenants import create_key, create_tenant
from tests.support.command import Command
from tests.support.live_api import LiveApi


@pytest.fixture(scope="module")
def job(api: LiveApi) -> str:
    with api.client() as client:
        prompts = [{"prompt": f"a person walks {n} steps", "name": f"take {n}", "variants": 2} for n in range(3)]
        job = client.submit(prompts, name="day 1")["id"]
        api.work()
    return job


def short(identifier: str) -> str:
    return identifier[-8:]


def test_a_job_is_named_by_digits_name_last_or_whole(marey: Command, job: str) -> None:
    for text in (job, short(job), short(job).upper(), "day 1", "last"):
        assert marey("jobs", "show", text, "--json").ok().lines[0]["id"] == job
        assert marey("jobs", "wait", text, "--json").ok().lines[0]["id"] == job
    marey("jobs", "show", "day 2").refused(3, "there is no such job", "marey jobs list")
    marey("jobs", "show", str(uuid4())).refused(3)


def test_a_motion_is_named_by_its_place_and_verdicts_go_where_they_belong(marey: Command, job: str) -> None:
    listed = marey("motions", "list", "--job", "day 1", "--json").ok().lines
    motions = {(m["index"], m["variant"]): m["id"] for m in listed}
    assert len(motions) == 6
    for text in (f"{job}:1.0", f"{short(job)}:1.0", "day 1:1.0", "last:1.0", short(motions[1, 0])):
        assert marey("motions", "keep", text, "--json").ok().lines[0]["id"] == motions[1, 0]
    said = marey("motions", "keep", "last:1").refused(2, "may be any of these", motions[1, 0], motions[1, 1])
    assert f"{short(job)}:1.1" in said.err
    stdin = f"day 1:2.0\n{motions[2, 1]} {short(motions[0, 0])}\n"
    assert {m["id"] for m in marey("motions", "reject", "-", "--json", stdin=stdin).ok().lines} == {
        motions[2, 0], motions[2, 1], motions[0, 0],
    }  # fmt: skip
    marey("motions", "keep", "last:9").refused(3, "there is no such motion")


def test_a_motion_that_is_not_made_is_told_from_one_that_does_not_exist(
    marey: Command, api: LiveApi, tmp_path: Path
) -> None:
    prompts = ["a person walks", "a person tangoes", "a person jumps"]
    with api.client() as client:
        job = client.submit([{"prompt": prompt} for prompt in prompts], name="not yet")["id"]
        items = [item["id"] for item in client.pages(f"/v1/jobs/{job}/items")]

    def file(reference: object, *words: str) -> None:
        marey("motions", "file", reference, "glb", "-o", tmp_path / "walk.glb").refused(3, *words)

    for reference in ("not yet:0", f"{short(job)}:1.0", "last:2", items[0]):
        file(reference, "the motion is not made yet: its item waits for a worker", f"`marey jobs wait {job}`")
    with api.http() as http:
        answer = http.get(f"/v1/motions/{items[0]}")
        assert (answer.status_code, "not made yet" in answer.json()["detail"]) == (404, True)
        given = {"motions": [items[0], str(uuid4())], "verdict": "kept"}
        assert "and 1 more" in http.post("/v1/motions/review", json=given).json()["detail"]
        pose = {"type": "pose_keyframe", "frame": 0, "motion": {"id": items[0], "frame": 0}}
        wanted = {"items": [{"prompt": "a person bows", "constraints": [pose]}]}
        assert "not made yet" in http.post("/v1/jobs", json=wanted).json()["problems"][0]["message"]
    marey("jobs", "pause", job).ok()
    file("not yet:0", f"Its job is paused: `marey jobs resume {job}` goes on.")
    marey("jobs", "resume", job).ok()

    api.work(fail=frozenset({prompts[1]}))
    (walk, _) = marey("motions", "list", "--job", job, "--json").ok().lines
    assert marey("motions", "keep", "not yet:0", "--json").ok().lines[0]["id"] == walk["id"]
    file(items[0], "this is an item, not a motion", f"Its motion is {walk['id']}.")
    file("not yet:1", "there is no motion: its item failed: this cannot be danced", "Walk.")
    failure = f"failed     {short(job)}:1.0 'a person tangoes': this cannot be danced"
    assert failure in marey("jobs", "show", job).ok().out.splitlines()
    file("not yet:0.1", "there is no such motion")
    file("not yet:3", "there is no such motion")
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks"}], name="never")["id"]
    marey("jobs", "cancel", job).ok()
    file("never:0", "there is no motion: its item was cancelled", f"`marey jobs retry {job}`")


def test_an_item_of_another_tenant_is_no_motion(marey: Command, api: LiveApi) -> None:
    with transaction(api.engine) as conn:
        create_tenant(conn, "beside")
        key = create_key(conn, "bea", ["admin"], tenant="beside").secret
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks"}])["id"]
        (item,) = client.pages(f"/v1/jobs/{job}/items")
    other = Command({"MAREY_SERVER": api.url, "MAREY_KEY": key})
    for reference in (item["id"], f"{job}:0"):
        other("motions", "keep", reference).refused(3, "there is no such motion")
    other("motions", "keep", "last").refused(3, "there is no motion yet")
    marey("jobs", "priority", job, 5000).refused(2, "marey: PRIORITY: 5000 is above 1,000")
    marey("submit", "a person walks", "--keep-days", 99999).refused(2, "marey: --keep-days: 99999 is above 36,500")
    marey("motions", "list", "--tag", "").refused(2, "marey: --tag: is empty")


def test_an_ambiguous_name_lists_its_candidates_and_nothing_is_done(marey: Command, api: LiveApi, job: str) -> None:
    with api.client() as client:
        made = [client.submit([{"prompt": "a person waits"}], name="twice")["id"] for _ in range(2)]
    for command in (("jobs", "cancel", "twice"), ("jobs", "delete", "-y", short(job), "twice")):
        marey(*command).refused(2, "'twice' may be any of these", *made, short(made[0]), "(1 item)")
    assert marey("jobs", "show", job).ok()
    assert "cancelled job " + short(made[0]) + " 'twice' (1 item)" in marey("jobs", "cancel", short(made[0])).ok().err
    assert f"deleted job {short(made[0])} 'twice' (1 item)" in marey("jobs", "delete", "-y", made[0]).ok().err
    assert f"cancelled job {short(made[1])}" in marey("jobs", "cancel", "twice").ok().err


def test_another_tenants_job_is_not_there(api: LiveApi, job: str) -> None:
    with transaction(api.engine) as conn:
        create_tenant(conn, "elsewhere")
        key = create_key(conn, "ann", ["admin"], tenant="elsewhere").secret
    other = Command({"MAREY_SERVER": api.url, "MAREY_KEY": key})
    for text in (job, short(job), "day 1"):
        other("jobs", "show", text).refused(3, "there is no such job")
    other("jobs", "show", "last").refused(3, "there is no job yet")


def drawn(api: LiveApi, *arguments: str) -> str:
    """Return the output of a command on a terminal of 80 columns."""
    master, slave = pty.openpty()
    environment = {**os.environ, "COLUMNS": "80", "TERM": "xterm", "MAREY_SERVER": api.url, "MAREY_KEY": api.key}
    command = [sys.executable, "-m", "marey.cli", *arguments]
    process = subprocess.Popen(command, stdout=slave, env=environment)
    os.close(slave)
    output = b""
    while True:
        try:
            piece = os.read(master, 65536)
        except OSError:
            break
        if not piece:
            break
        output += piece
    assert process.wait(60) == 0
    os.close(master)
    return re.sub(r"\x1b\[[0-9;]*m", "", output.decode())


def test_tables_fit_eighty_columns_with_ids_on_one_line(api: LiveApi, marey: Command, job: str) -> None:
    for arguments in (("jobs", "list"), ("motions", "list")):
        ids = [row["id"] for row in marey(*arguments, "--json").ok().lines]
        lines = drawn(api, *arguments).splitlines()
        assert max(map(len, lines)) <= 80
        for identifier in ids:
            assert sum(line.startswith(short(identifier)) for line in lines) == 1
        assert not any(ids[0] in line for line in lines)
        whole = drawn(api, *arguments, "-l").splitlines()
        assert all(any(line.startswith(identifier) for line in whole) for identifier in ids)
        assert ids == [line.split("\t")[0] for line in marey(*arguments).ok().out.splitlines()], "a pipe gets whole ids"
