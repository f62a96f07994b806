"""A backup brings back what was there, and believes nothing that it is given."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.cli.backup import BackupManifest, export_tenant, import_tenant
from marey.core.errors import Conflict, InvalidFile, InvalidInput, MareyError, NotFound
from marey.db import transaction
from marey.jobs import (
    EDIT_QUEUE,
    ItemFailure,
    JobRow,
    NewMotion,
    Review,
    asset_key,
    begin_assets,
    cancel,
    commit_motions,
    events_after,
    fail_items,
    get_job,
    list_items,
    list_jobs,
    retry,
)
from marey.jobs.types import EventRow, ItemRow
from marey.storage import FolderStore
from marey.takes import (
    GarbageReport,
    NewEdit,
    NewRig,
    add_rig,
    collect_garbage,
    erase,
    list_rigs,
    remove_rig,
    reroll,
    review,
    submit_edit,
)
from marey.tenants import Actor
from tests.servers.audit import audit
from tests.servers.jobs import MODEL, PROBLEM, claim_some, motion_of, new_item, parse_texts, submit_items
from tests.support.marey import Marey

TABLES = "job, asset, text_features, idempotency"


def work(engine: sa.Engine, store: FolderStore, *, fail: int = 0, queue: str = MODEL) -> None:
    claimed = claim_some(engine, queue)
    good = claimed.items[: len(claimed.items) - fail]
    motions: list[NewMotion] = [motion_of(item.id) for item in good]
    with transaction(engine) as conn:
        begin_assets(conn, claimed.lease_token, [file for motion in motions for file in motion.files.values()])
        for motion in motions:
            store.put(asset_key("default", motion.files["npz"].sha256), str(motion.item).encode())
        bad = claimed.items[len(good) :]
        fail_items(conn, claimed.lease_token, [ItemFailure(item.id, PROBLEM, False) for item in bad])
        commit_motions(conn, claimed.lease_token, motions)


def studio(engine: sa.Engine, store: FolderStore) -> list[UUID]:
    """A job with a failed item, a verdict and a re-roll; one that was cancelled before its prompts were read."""
    rows = [{"start": 0.0, "end": 3.0, "prompt": "walk"}]
    items = [new_item(k, name=f"n{k}", tags=(f"shot={k}",)) for k in range(4)]
    items[0] = replace(
        items[0], timeline=rows, constraints=[{"type": "root_path", "frames": [0], "positions_xz": [[0.0, 1.0]]}]
    )
    rich = submit_items(engine, items, name="rich")
    parse_texts(engine)
    work(engine, store, fail=1)
    with transaction(engine) as conn:
        motions = [item.motion.id for item in list_items(conn, "default", rich).rows if item.motion]
        review(conn, "default", motions[:1], Review.KEPT, by="ann", comment="good")
        reroll(conn, "default", motions[1:2], lambda item: new_item(item.index, item.prompt), by="ann")
    work(engine, store)
    gone = submit_items(engine, [new_item(0, "nobody walks")], keep_days=1)
    with transaction(engine) as conn:
        cancel(conn, "default", gone)
    return [rich, gone]


def snapshot(engine: sa.Engine, jobs: Sequence[UUID]) -> list[tuple[JobRow, Sequence[ItemRow], list[EventRow]]]:
    with transaction(engine) as conn:
        return [
            (get_job(conn, "default", job), list_items(conn, "default", job).rows, events_after(conn, "default", job))
            for job in jobs
        ]


def contents(store: FolderStore) -> dict[str, bytes]:
    return {key: store.get(key) for key in list(store.keys())}


def lose_everything(engine: sa.Engine, store: FolderStore) -> None:
    with transaction(engine) as conn:
        conn.execute(sa.text(f"TRUNCATE {TABLES} CASCADE"))
    for key in list(store.keys()):
        store.delete(key)


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


def motion_in(engine: sa.Engine, job: UUID) -> UUID:
    """The first motion of a job."""
    with transaction(engine) as conn:
        (first, *_) = (item.motion.id for item in list_items(conn, "default", job).rows if item.motion)
    return first


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


def test_a_rig_that_no_text_can_hold_is_refused(engine: sa.Engine, folder_store: FolderStore, tmp_path: Path) -> None:
    character(engine, folder_store, rig_map={"hips": "Hips"})
    export_tenant(engine, folder_store, "default", tmp_path / "b")
    edit_rigs(tmp_path / "b", lambda d: d.replace(b'"hips":"Hips"', b'"hips":"\\u0000"'))
    lose_everything(engine, folder_store)
    with pytest.raises(InvalidFile, match="the database refuses it"):
        import_tenant(engine, folder_store, "default", tmp_path / "b")
    assert rigs_of(engine) == []


def character(
    engine: sa.Engine,
    store: FolderStore,
    name: str = "hero",
    data: bytes = b"a character",
    rig_map: dict[str, str | None] | None = None,
) -> None:
    new = NewRig("default", name, "glb", data, rig_map, {"parts": {"hips": {"joint": "Hips", "how": "words"}}})
    add_rig(engine, store, new, Actor("ann", None), limit=9)


def rigs_of(engine: sa.Engine) -> list[dict[str, Any]]:
    """The rigs, in the order of their names; their ids are made anew."""
    with transaction(engine) as conn:
        rows = list_rigs(conn, "default").rows
    return sorted(({**vars(row), "id": None} for row in rows), key=lambda row: row["name"])


def test_another_tenants_job_is_not_overwritten_and_a_folder_with_something_in_it_is_not_used(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    studio(engine, folder_store)
    export_tenant(engine, folder_store, "default", tmp_path / "b")
    with pytest.raises(InvalidInput, match="not empty"):
        export_tenant(engine, folder_store, "default", tmp_path / "b")
    with engine.begin() as conn:
        conn.execute(sa.text("INSERT INTO tenant (id) VALUES ('other')"))
    with pytest.raises(Conflict, match="another tenant"):
        import_tenant(engine, folder_store, "other", tmp_path / "b")
    with transaction(engine) as conn:
        assert list_jobs(conn, "other").rows == ()


def test_an_edit_of_another_tenants_motion_is_not_imported(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    source, stranger = (submit_items(engine, 1) for _ in range(2))
    parse_texts(engine)
    work(engine, folder_store)
    work(engine, folder_store)
    made = mirrored(engine, folder_store, source)
    export_tenant(engine, folder_store, "default", tmp_path / "b")
    theirs = motion_in(engine, stranger)
    with engine.begin() as conn:
        conn.execute(sa.text("INSERT INTO tenant (id) VALUES ('other')"))
        conn.execute(sa.text("DELETE FROM job WHERE id <> :job"), {"job": stranger})
    forge_sources(tmp_path / "b", made, theirs)
    with pytest.raises(InvalidFile, match=f"an edit is of motion {theirs}, which another tenant has"):
        import_tenant(engine, folder_store, "other", tmp_path / "b")
    with transaction(engine) as conn:
        assert list_jobs(conn, "other").rows == ()


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


def mirrored(engine: sa.Engine, store: FolderStore, source: UUID) -> UUID:
    """The finished job of an edit of a job's motion."""
    with transaction(engine) as conn:
        made = submit_edit(conn, NewEdit(motion_in(engine, source), [{"op": "mirror"}])).id
    work(engine, store, queue=EDIT_QUEUE)
    return made


def forge_sources(folder: Path, job: UUID, motion: UUID) -> None:
    """Leave one job in a backup, and let its edits be of a motion."""
    manifest = BackupManifest.model_validate_json((folder / "manifest.json").read_bytes())
    path = folder / "jobs" / f"{job}.jsonl"
    lines = [json.loads(line) for line in path.read_bytes().splitlines()]
    for line in lines:
        if "item" in line:
            line["item"]["edits"]["sources"] = line["item"]["edited_from"] = [str(motion)]
    data = b"".join(json.dumps(line).encode() + b"\n" for line in lines)
    path.write_bytes(data)
    assert job in manifest.jobs
    edit_manifest(folder, jobs={str(job): {"sha256": hashlib.sha256(data).hexdigest(), "size": len(data)}})


def edit_manifest(folder: Path, **changes: object) -> None:
    document = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(document | changes))


def edit_job(folder: Path, change: Callable[[bytes], bytes]) -> None:
    """Change the records of the first job, and its hash with them: a forger's work."""
    manifest = BackupManifest.model_validate_json((folder / "manifest.json").read_bytes())
    first = next(iter(manifest.jobs))
    path = folder / "jobs" / f"{first}.jsonl"
    data = change(path.read_bytes())
    path.write_bytes(data)
    jobs = {str(job): entry.model_dump() for job, entry in manifest.jobs.items()}
    jobs[str(first)] = {"sha256": hashlib.sha256(data).hexdigest(), "size": len(data)}
    edit_manifest(folder, jobs=jobs)


def edit_rigs(folder: Path, change: Callable[[bytes], bytes]) -> None:
    """Change the records of the rigs, and their hash with them."""
    path = folder / "rigs.jsonl"
    data = change(path.read_bytes())
    path.write_bytes(data)
    edit_manifest(folder, rig_records={"sha256": hashlib.sha256(data).hexdigest(), "size": len(data)})


def a_file(folder: Path) -> Path:
    return next(path for path in (folder / "files").rglob("*") if path.is_file())


def link_away(folder: Path) -> None:
    path = a_file(folder)
    (folder / "outside").write_bytes(path.read_bytes())
    path.unlink()
    path.symlink_to(folder / "outside")


NOBODY = b"00000000-0000-7000-8000-000000000000"
NAMED_MOTION = b'"constraints":[{"type":"pose_keyframe","frame":0,"motion":{"id":"%s","frame":0}}]' % NOBODY


DAMAGE: dict[str, tuple[Callable[[Path], object], type[MareyError], str]] = {
    "no manifest": (lambda b: (b / "manifest.json").unlink(), NotFound, "no whole backup"),
    "another version": (lambda b: edit_manifest(b, version=2), InvalidFile, "version"),
    "a path for a job": (lambda b: edit_manifest(b, jobs={"../../x": {}}), InvalidFile, "jobs"),
    "no job file": (lambda b: [p.unlink() for p in (b / "jobs").iterdir()], InvalidFile, "is missing"),
    "no content": (lambda b: a_file(b).unlink(), InvalidFile, "is missing"),
    "other content": (lambda b: a_file(b).write_bytes(b"x" * 36), InvalidFile, "another hash"),
    "a link": (link_away, InvalidFile, "is a link"),
    "other records": (
        lambda b: [p.write_bytes(p.read_bytes().replace(b"walk", b"hack")) for p in (b / "jobs").iterdir()],
        InvalidFile,
        "another hash",
    ),
    "a forged state": (
        lambda b: edit_job(b, lambda d: d.replace(b'"state":"failed"', b'"state":"succeeded"', 1)),
        InvalidFile,
        "has no motion",
    ),
    "a forged path for a file": (
        lambda b: edit_job(b, lambda d: d.replace(b'"sha256":"', b'"sha256":"../../', 1)),
        InvalidFile,
        "sha256",
    ),
    "an unknown field": (lambda b: edit_job(b, lambda d: d.replace(b'"seed":', b'"sead":', 1)), InvalidFile, "seed"),
    "no JSON": (lambda b: edit_job(b, lambda d: d + b"\x80\x04pickle\n"), InvalidFile, "not a record of a backup"),
    "another job": (
        lambda b: edit_job(b, lambda d: d.replace(b'{"job":{"id":"0', b'{"job":{"id":"1', 1)),
        InvalidFile,
        "holds job",
    ),
    "no rigs": (lambda b: (b / "rigs.jsonl").unlink(), InvalidFile, "is missing"),
    "other rigs": (lambda b: (b / "rigs.jsonl").write_bytes(b"x"), InvalidFile, "another hash"),
    "a rig of a foreign name": (
        lambda b: edit_rigs(b, lambda d: d.replace(b'"name":"hero"', b'"name":"../hero"')),
        InvalidFile,
        "name",
    ),
    "a reference rig": (
        lambda b: edit_rigs(b, lambda d: d.replace(b'"name":"hero"', b'"name":"mixamo"')),
        InvalidFile,
        "reference rig",
    ),
    "a rig twice": (lambda b: edit_rigs(b, lambda d: d + d), InvalidFile, "two rigs have one name"),
    "a job among the rigs": (
        lambda b: edit_rigs(b, lambda d: b'{"job":{}}\n' + d),
        InvalidFile,
        "not a record of a backup",
    ),
    "a rig without its file": (
        lambda b: edit_rigs(b, lambda d: re.sub(rb'"sha256":"\w{64}","size"', b'"sha256":"%064d","size"' % 0, d)),
        InvalidFile,
        "is missing",
    ),
    "a constraint that is none": (
        lambda b: edit_job(b, lambda d: d.replace(b'"root_path"', b'"root_paht"', 1)),
        InvalidFile,
        "constraints.0.type",
    ),
    "a constraint that names a motion": (
        lambda b: edit_job(b, lambda d: re.sub(rb'"constraints":\[\{.*?\}\]', NAMED_MOTION, d, count=1)),
        InvalidFile,
        "names a motion in constraints.0.motion",
    ),
    "a timeline that is none": (
        lambda b: edit_job(b, lambda d: d.replace(b'"end":3.0', b'"end":0.5', 1)),
        InvalidFile,
        "row 1",
    ),
    "sources of an item that is no edit": (
        lambda b: edit_job(b, lambda d: d.replace(b'"edited_from":[]', b'"edited_from":["%s"]' % NOBODY, 1)),
        InvalidFile,
        "edited from other motions",
    ),
    "edits that hide their source": (
        lambda b: edit_job(b, lambda d: d.replace(b'"edits":null', b'"edits":{"ops":[],"sources":["%s"]}' % NOBODY, 1)),
        InvalidFile,
        "edited from other motions",
    ),
    "edits of another form": (
        lambda b: edit_job(b, lambda d: d.replace(b'"edits":null', b'"edits":{"ops":[]}', 1)),
        InvalidFile,
        "edits that cannot be read",
    ),
    "a problem of another form": (
        lambda b: edit_job(b, lambda d: d.replace(b'"problem":{', b'"problem":{"age":1,', 1)),
        InvalidFile,
        "problem",
    ),
    "a scope of another form": (
        lambda b: edit_job(b, lambda d: d.replace(b'"scope":null', b'"scope":{"verdict":"good"}', 1)),
        InvalidFile,
        "scope",
    ),
    "metadata of another form": (
        lambda b: edit_job(b, lambda d: d.replace(b'"metadata":{}', b'"metadata":{"prompts":5}', 1)),
        InvalidFile,
        "metadata.*prompts",
    ),
    "a rate that is no number": (
        lambda b: edit_job(b, lambda d: re.sub(rb'"fps":[0-9.]+', b'"fps":NaN', d, count=1)),
        InvalidFile,
        "fps: is not a finite number",
    ),
    "no frames a second": (
        lambda b: edit_job(b, lambda d: re.sub(rb'"fps":[0-9.]+', b'"fps":0', d, count=1)),
        InvalidFile,
        "fps: is not above 0",
    ),
    "a manifest of a gigabyte": (
        lambda b: os.truncate(b / "manifest.json", 2**30),
        InvalidFile,
        "manifest.json: is over 256 MiB",
    ),
    "what no text can hold": (
        lambda b: edit_job(b, lambda d: d.replace(b'"name":"rich"', b'"name":"\\u0000"', 1)),
        InvalidFile,
        "the database refuses it",
    ),
}


def test_a_damaged_or_forged_backup_is_refused_and_nothing_is_written(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    studio(engine, folder_store)
    character(engine, folder_store)
    export_tenant(engine, folder_store, "default", tmp_path / "good")
    lose_everything(engine, folder_store)
    for name, (damage, error, words) in DAMAGE.items():
        folder = tmp_path / name
        shutil.copytree(tmp_path / "good", folder)
        damage(folder)
        with pytest.raises(error, match=words):
            import_tenant(engine, folder_store, "default", folder)
        with transaction(engine) as conn:
            assert list_jobs(conn, "default").rows == (), name
            assert list_rigs(conn, "default").rows == (), name


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
