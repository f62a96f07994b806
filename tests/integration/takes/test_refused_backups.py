"""A backup is believed in nothing: what is damaged, forged or of another tenant writes nothing."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.cli.backup import BackupManifest, export_tenant, import_tenant
from marey.core.errors import Conflict, InvalidFile, InvalidInput, MareyError, NotFound
from marey.db import transaction
from marey.jobs import list_jobs
from marey.storage import FolderStore
from marey.takes import list_rigs
from tests.servers.jobs import parse_texts, submit_items
from tests.support.backups import character, lose_everything, mirrored, motion_in, rigs_of, studio, work


def test_a_rig_that_no_text_can_hold_is_refused(engine: sa.Engine, folder_store: FolderStore, tmp_path: Path) -> None:
    character(engine, folder_store, rig_map={"hips": "Hips"})
    export_tenant(engine, folder_store, "default", tmp_path / "b")
    edit_rigs(tmp_path / "b", lambda d: d.replace(b'"hips":"Hips"', b'"hips":"\\u0000"'))
    lose_everything(engine, folder_store)
    with pytest.raises(InvalidFile, match="the database refuses it"):
        import_tenant(engine, folder_store, "default", tmp_path / "b")
    assert rigs_of(engine) == []


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
