"""A backup brings back what was there."""

from __future__ import annotations

import json
from pathlib import Path
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.cli.backup import export_tenant, import_tenant
from marey.core.errors import Conflict, NotFound
from marey.db import transaction
from marey.jobs import EDIT_QUEUE, get_job, retry
from marey.storage import FolderStore
from marey.takes import GarbageReport, NewEdit, collect_garbage, erase, remove_rig, submit_edit
from tests.servers.audit import audit
from tests.servers.jobs import parse_texts, submit_items
from tests.support.backups import (
    character,
    contents,
    lose_everything,
    mirrored,
    motion_in,
    rigs_of,
    snapshot,
    studio,
    work,
)
from tests.support.marey import Marey


def test_an_edit_comes_back_with_the_motions_that_it_was_made_from(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    source = submit_items(engine, 1)
    parse_texts(engine)
    work(engine, folder_store)
    edits: list[UUID] = []
    motion = motion_in(engine, source)
    for _ in range(2):  # an edit of an edit
        with transaction(engine) as conn:
            edits.append(submit_edit(conn, NewEdit(motion, [{"op": "mirror"}])).id)
        work(engine, folder_store, queue=EDIT_QUEUE)
        motion = motion_in(engine, edits[-1])
    before = snapshot(engine, edits)
    export_tenant(engine, folder_store, "default", tmp_path / "b")
    lose_everything(engine, folder_store)
    import_tenant(engine, folder_store, "default", tmp_path / "b")
    assert snapshot(engine, edits) == before
    with transaction(engine) as conn:
        assert erase(conn, "default", source, by="ann").edits == tuple(edits)


def test_what_was_lost_comes_back_as_it_was(engine: sa.Engine, folder_store: FolderStore, tmp_path: Path) -> None:
    jobs = studio(engine, folder_store)
    running = submit_items(engine, 1)
    before, files = snapshot(engine, jobs), contents(folder_store)
    manifest, left = export_tenant(engine, folder_store, "default", tmp_path / "b")
    assert (list(manifest.jobs), manifest.items, manifest.files, left) == (jobs, 6, 4, 1)
    lose_everything(engine, folder_store)
    assert import_tenant(engine, folder_store, "default", tmp_path / "b")[1] == (2, 0)
    after = snapshot(engine, jobs)
    assert after[0] == before[0]
    assert (after[1][0].keep_days, before[1][0].keep_days) == (None, 1)  # its days are over, or would soon be
    assert after[1][1:] == before[1][1:]
    assert contents(folder_store) == files
    with transaction(engine) as conn:
        assert audit(conn) == []
        with pytest.raises(NotFound):
            get_job(conn, "default", running)
        with pytest.raises(Conflict, match="came from a backup"):
            retry(conn, "default", jobs[0])
    assert collect_garbage(engine, folder_store) == GarbageReport(0, 0, ())
    assert import_tenant(engine, folder_store, "default", tmp_path / "b")[1] == (0, 0)  # again: nothing to do
    assert snapshot(engine, jobs) == after


def test_rigs_come_back_and_a_name_that_is_taken_is_left_alone(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    character(engine, folder_store, rig_map={"left_toes": None})
    character(engine, folder_store, "lead", b"another character")
    character(engine, folder_store, "lead", b"the lead's second version")
    before, files = rigs_of(engine), contents(folder_store)
    assert [(rig["name"], rig["version"]) for rig in before] == [("hero", 1), ("lead", 2)]
    manifest, _ = export_tenant(engine, folder_store, "default", tmp_path / "b")
    assert (manifest.rigs, manifest.files) == (2, 2)
    lose_everything(engine, folder_store)
    assert import_tenant(engine, folder_store, "default", tmp_path / "b")[1] == (0, 2)
    assert (rigs_of(engine), contents(folder_store)) == (before, files)
    assert collect_garbage(engine, folder_store) == GarbageReport(0, 0, ())
    with transaction(engine) as conn:
        assert audit(conn) == []
        remove_rig(conn, "default", "hero")
    character(engine, folder_store, "hero", b"another hero")
    mine = rigs_of(engine)
    assert import_tenant(engine, folder_store, "default", tmp_path / "b")[1] == (0, 0)
    assert rigs_of(engine) == mine


def test_a_backup_of_a_release_that_left_rigs_out_is_imported(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    jobs = studio(engine, folder_store)
    export_tenant(engine, folder_store, "default", tmp_path / "b")
    (tmp_path / "b" / "rigs.jsonl").unlink()
    path = tmp_path / "b" / "manifest.json"
    document = json.loads(path.read_text())
    path.write_text(json.dumps({name: value for name, value in document.items() if "rig" not in name}))
    lose_everything(engine, folder_store)
    assert import_tenant(engine, folder_store, "default", tmp_path / "b")[1] == (2, 0)
    assert [row.id for row, *_ in snapshot(engine, jobs)] == jobs


def test_an_erasure_leaves_jobs_of_other_tenants_alone(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    source = submit_items(engine, 1)
    parse_texts(engine)
    work(engine, folder_store)
    made = mirrored(engine, folder_store, source)
    with engine.begin() as conn:  # a link that no import writes any more
        conn.execute(sa.text("INSERT INTO tenant (id) VALUES ('other')"))
        conn.execute(sa.text("UPDATE motion SET tenant_id = 'other' WHERE job_id = :job"), {"job": made})
        conn.execute(sa.text("UPDATE job SET tenant_id = 'other' WHERE id = :job"), {"job": made})
    with transaction(engine) as conn:
        assert erase(conn, "default", source, by="ann").edits == ()
        assert get_job(conn, "other", made).erased is None


def test_the_commands_say_what_they_did(
    engine: sa.Engine, database_url: str, folder_store: FolderStore, tmp_path: Path
) -> None:
    studio(engine, folder_store)
    character(engine, folder_store)
    environment = {"MAREY_DATABASE_URL": database_url, "MAREY_STORE": str(folder_store.root)}
    marey = Marey(tmp_path / "home", tmp_path / "models", environment)
    ran = marey("admin", "export", tmp_path / "b").ok()
    assert "2 jobs of 6 items in all, 1 rigs, 5 files" in ran.err
    lose_everything(engine, folder_store)
    ran = marey("admin", "import", tmp_path / "b", "--json").ok()
    (line,) = ran.lines
    assert [line[name] for name in ("tenant", "jobs", "written", "rigs", "rigs_written")] == ["default", 2, 2, 1, 1]
    assert len(contents(folder_store)) == 5
    ran = marey("admin", "import", tmp_path / "b").ok()
    assert "0 jobs of 6 items in all, 0 rigs, 5 files" in ran.err
    assert "2 jobs and 1 rigs were there already" in ran.err
