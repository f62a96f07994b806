"""Edits from Python and the command line, and the way back to a source."""

from __future__ import annotations

import json
from pathlib import Path
from uuid import UUID

import httpx2
import pytest

from marey.client import Client
from marey.core.errors import Conflict, InvalidInput, NotFound, TooLarge
from marey.db import transaction
from marey.takes import delete
from marey.tenants import DEFAULT_TENANT
from tests.support.command import Command
from tests.support.editing import edited, stored, working_editor
from tests.support.live_api import LiveApi


def test_operations_apply_in_the_order_of_the_command_line(marey: Command, api: LiveApi, tmp_path: Path) -> None:
    source, other = stored(api, "a person walks"), stored(api, "a person waves")
    with working_editor(api):
        done = marey(
            *("motions", "edit", source["id"][-8:], "--trim", "f0:f20", "--concat", other["id"][-8:], "--blend", "0.1"),
            *("--split", "f10", "--mirror", "--json"),
        )
    assert done.code == 0, done.err
    first, second = map(json.loads, done.out.splitlines())
    assert [first["frames"], second["frames"]] == [11, 51]
    assert first["edited_from"] == second["edited_from"] == [source["id"], other["id"]]
    with Client(api.url, api.key) as client:
        (item, _) = client.jobs.items(first["job"])
        pieces = [fetched.files["npz"] for fetched in client.jobs.fetch(first["job"], tmp_path)]
    assert len({*pieces}) == 2
    assert item.edits is not None
    assert [op["op"] for op in item.edits.ops] == ["trim", "concat", "trim", "mirror"]
    assert item.edits.ops[1] == {"op": "concat", "with": other["id"], "blend": 0.1}


def test_a_file_of_operations_and_a_job_that_is_not_waited_for(marey: Command, api: LiveApi, tmp_path: Path) -> None:
    source = stored(api)
    (tmp_path / "ops.json").write_text(json.dumps([{"op": "speed", "factor": 2}]))
    done = marey("motions", "edit", source["id"], "--ops", tmp_path / "ops.json", "--no-wait", "--name", "fast")
    assert done.code == 0, done.err
    assert "kind       edit\nstate      queued" in marey("jobs", "show", done.out.strip()).out
    with working_editor(api):
        assert marey("jobs", "wait", done.out.strip()).code == 0
    both = marey("motions", "edit", source["id"], "--ops", tmp_path / "ops.json", "--loop")
    assert (both.code, "--ops: cannot be combined" in both.err) == (2, True)
    none = marey("motions", "edit", source["id"])
    assert (none.code, "motions edit --help" in none.err) == (2, True)


def test_what_cannot_be_edited_is_told_with_the_reason(marey: Command, api: LiveApi) -> None:
    source = stored(api)
    with working_editor(api):
        done = marey("motions", "edit", source["id"], "--trim", "99:")
    assert done.code == 6
    failure = "operation 1 (trim): 99 s is after the end of the motion"
    assert failure in done.err
    assert failure in marey("jobs", "show", "last").ok().out
    assert marey("motions", "edit", source["id"], "--concat", "0" * 8).code == 3
    marey("motions", "edit", source["id"], "--speed", "99").refused(2, "--speed 99: 99.0 is not a number")


def test_python_edits_with_motions_and_ids(api: LiveApi) -> None:
    first, second = stored(api, tags=["shot=010"]), stored(api)
    with Client(api.url, api.key) as client, working_editor(api):
        job = client.edit(
            first["id"], [{"op": "concat", "with": client.motions.get(second["id"])}], name="both", keep_days=3
        )
        assert (job.kind, job.name, job.keep_days) == ("edit", "both", 3)
        client.jobs.wait(job, timeout=60)
        (motion,) = client.motions.list(job=job)
        assert motion.edited_from == (first["id"], second["id"])
        assert motion.tags == ("shot=010",)
        same = [client.edit(first["id"], [{"op": "mirror"}], idempotency_key="once").id for _ in range(2)]
        assert len({*same}) == 1
        with pytest.raises(InvalidInput, match=r"ops.0.op") as refused:
            client.edit(first["id"], [{"op": "explode"}])
        assert "Known: trim" in (refused.value.hint or "")
        with pytest.raises(TooLarge, match="64 pieces"):
            client.edit(first["id"], [{"op": "split", "at": 0.1}] * 6)
        with pytest.raises(NotFound):
            client.edit("01a20000-0000-7000-8000-000000000000", [{"op": "mirror"}])


def test_a_source_is_current_again_and_nothing_is_deleted(marey: Command, api: LiveApi, http: httpx2.Client) -> None:
    source = stored(api)
    (edit,) = edited(api, source["id"], {"op": "mirror"})
    with Client(api.url, api.key) as client:
        client.motions.reject(source["id"])
        assert client.motions.revert(edit["id"]).id == source["id"]
        assert client.motions.get(source["id"]).review is None
        rejected = client.motions.get(edit["id"]).review
        assert rejected is not None
        assert (rejected.verdict, rejected.comment) == ("rejected", "reverted to its source")
        client.motions.keep(edit["id"])
    done = marey("motions", "revert", edit["id"][-8:])
    assert done.out.split() == [source["id"]]
    before = [http.get(f"/v1/motions/{each['id']}").json()["review"] for each in (source, edit)]
    assert [each["verdict"] for each in before] == ["kept", "rejected"]
    assert marey("motions", "revert", edit["id"], "--json").code == 0
    assert [http.get(f"/v1/motions/{each['id']}").json()["review"] for each in (source, edit)] == before


def test_only_an_edit_whose_source_exists_is_reverted(api: LiveApi) -> None:
    source = stored(api)
    (edit,) = edited(api, source["id"], {"op": "mirror"})
    with Client(api.url, api.key) as client:
        with pytest.raises(Conflict, match="was not edited"):
            client.motions.revert(source["id"])
        with transaction(api.engine) as conn:
            delete(conn, DEFAULT_TENANT, UUID(source["job"]))
        with pytest.raises(NotFound, match="the motion that it was made from was deleted"):
            client.motions.revert(edit["id"])


def test_a_dry_run_submits_nothing(marey: Command, api: LiveApi) -> None:
    source = stored(api)
    with Client(api.url, api.key) as client:
        before = [job.id for job in client.jobs.list()]
        done = marey("motions", "edit", source["id"][-8:], "--split", "f20", "--dry-run", "--json").ok()
        assert "2 motions would be made, with edit; nothing was submitted." in done.err
        assert (json.loads(done.out)["items"], json.loads(done.out)["valid"]) == (2, True)
        refused = marey("motions", "edit", source["id"], "--concat", "0" * 32, "--dry-run")
        assert (refused.code, f"--concat {'0' * 32}: " in refused.err) == (3, True), refused.err
        checked = client.check_edit(source["id"], [{"op": "mirror"}])
        assert (checked.valid, checked.items, checked.bundles, len(checked.prompts)) == (True, 1, ("edit",), 1)
        assert [job.id for job in client.jobs.list()] == before
