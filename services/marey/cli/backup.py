"""A backup: a folder of a tenant's ended jobs and their files, each with its hash.

`manifest.json` (written last: without it a backup is not whole) names `jobs/ID.jsonl` with their SHA-256; a job's first
line is the job, then a line an item with its motion, then a line an event. `rigs.jsonl` has a line for each rig.
`files/ab/ab…` hold content under its hash.
Plain JSON and bytes: nothing in it is ever run or unpickled, and no path is taken from it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple
from uuid import UUID

import sqlalchemy as sa
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError

from marey.backup import JobBackup, announce, back_up, ended_jobs, restore
from marey.core.errors import Conflict, InvalidFile, InvalidInput, NotFound
from marey.core.hashing import sha256_of
from marey.core.validation import first_problem
from marey.db import BACKUP, transaction
from marey.jobs import asset_key
from marey.motion.files import write_atomically
from marey.storage import AssetStore
from marey.takes import RigRecord, back_up_rigs, restore_rig
from marey.tenants import get_tenant

MANIFEST = "manifest.json"
RIGS = "rigs.jsonl"
MOST_MANIFEST = 2**28
"""Bytes of a manifest: a job takes 160."""
MOST_BYTES = 2**31
"""Bytes of a job's records: 100,000 items take about 0.5 GiB."""
TRIES = 3


class Entry(BaseModel):
    """Records of a job, or of all rigs."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    size: int = Field(ge=0, le=MOST_BYTES)


class BackupManifest(BaseModel):
    """The manifest of a backup.

    Attributes:
        files, bytes: of the content of motions and rigs.
        rigs: number of rigs.
        rig_records: of `rigs.jsonl`; None in backups of releases that left rigs out.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["marey-backup"] = "marey-backup"
    version: Literal[1] = 1
    tenant: str
    created: AwareDatetime
    items: int
    files: int
    bytes: int
    jobs: dict[UUID, Entry]
    rigs: int = 0
    rig_records: Entry | None = None


class Restored(NamedTuple):
    """Numbers of what an import wrote; the rest was there already."""

    jobs: int
    rigs: int


def export_tenant(
    engine: sa.Engine, store: AssetStore, tenant: str, folder: Path, *, done: Callable[[UUID], None] = lambda _: None
) -> tuple[BackupManifest, int]:
    """Back up the ended jobs and the rigs of a tenant; return the manifest, and the number of jobs that have not ended.

    Raises:
        InvalidInput: the folder is not empty, or cannot be written.
        Conflict: a job changed meanwhile.
        NotFound: no such tenant; or the store lacks a file, which is a loss of data.
    """
    with transaction(engine, BACKUP) as conn:
        get_tenant(conn, tenant)
        jobs, running = ended_jobs(conn, tenant)
    _prepare(folder)
    entries: dict[UUID, Entry] = {}
    items = 0
    files: dict[str, int] = {}
    for job in jobs:
        with transaction(engine, BACKUP, snapshot=True) as conn:
            backup = back_up(conn, tenant, job)
        data = b"".join(_lines(backup))
        for sha256, asset in backup.assets().items():
            if sha256 not in files:
                _save(store, tenant, sha256, folder)
                files[sha256] = asset.size
        write_atomically(folder / "jobs" / f"{job}.jsonl", data)
        entries[job] = Entry(sha256=hashlib.sha256(data).hexdigest(), size=len(data))
        items += len(backup.items)
        done(job)
    rigs, rig_entry = _export_rigs(engine, store, tenant, folder, files)
    manifest = BackupManifest(
        tenant=tenant,
        created=datetime.now(UTC),
        items=items,
        files=len(files),
        bytes=sum(files.values()),
        jobs=entries,
        rigs=rigs,
        rig_records=rig_entry,
    )
    write_atomically(folder / MANIFEST, (manifest.model_dump_json(indent=1) + "\n").encode())
    return manifest, running


def _export_rigs(
    engine: sa.Engine, store: AssetStore, tenant: str, folder: Path, files: dict[str, int]
) -> tuple[int, Entry]:
    """Write the records of the rigs, and those of their files that are not there yet."""
    with transaction(engine, BACKUP, snapshot=True) as conn:
        rigs = back_up_rigs(conn, tenant)
    for rig in rigs:
        if rig.sha256 not in files:
            _save(store, tenant, rig.sha256, folder)
            files[rig.sha256] = rig.size
    data = b"".join(_line("rig", rig.model_dump(mode="json")) for rig in rigs)
    write_atomically(folder / RIGS, data)
    return len(rigs), Entry(sha256=hashlib.sha256(data).hexdigest(), size=len(data))


def import_tenant(
    engine: sa.Engine, store: AssetStore, tenant: str, folder: Path, *, done: Callable[[UUID], None] = lambda _: None
) -> tuple[BackupManifest, Restored]:
    """Verify a whole backup, then restore the jobs and rigs that do not exist; return its manifest, and the numbers of
    both. A rig whose name is taken is left out.

    Each job and each rig is one transaction: an import that broke off continues when it is run again.

    Raises:
        NotFound: there is no backup, or no such tenant.
        InvalidFile: a file is missing, has another hash or is foreign; nothing was written then.
        Conflict: another tenant has a job of it.
    """
    with transaction(engine, BACKUP) as conn:
        get_tenant(conn, tenant)
    manifest = read_manifest(folder)
    for job, entry in manifest.jobs.items():
        for sha256, asset in read_job(folder, job, entry).assets().items():
            _check_content(folder, sha256, asset.size)
    rigs = read_rigs(folder, manifest)
    for rig in rigs:
        _check_content(folder, rig.sha256, rig.size)
    written = 0
    for job, entry in manifest.jobs.items():
        written += _restore(engine, store, tenant, folder, read_job(folder, job, entry))
        done(job)
    added = sum(restore_rig(engine, store, tenant, rig, _content(folder, rig.sha256).read_bytes()) for rig in rigs)
    return manifest, Restored(written, added)


def read_manifest(folder: Path) -> BackupManifest:
    """Read the manifest of a backup; raises as `import_tenant`."""
    path = folder / MANIFEST
    try:
        if _plain(path).stat().st_size > MOST_MANIFEST:
            raise InvalidFile(f"is over {MOST_MANIFEST // 2**20} MiB: no manifest of a backup", where=str(path))
        return BackupManifest.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        raise NotFound(
            "there is no whole backup", where=str(path), hint="The manifest is written last; was it broken off?"
        ) from None
    except ValidationError as error:
        raise _invalid(path, error) from None


def read_job(folder: Path, job: UUID, entry: Entry) -> JobBackup:
    """Read and check the records of a job; raises as `import_tenant`."""
    path = folder / "jobs" / f"{job}.jsonl"
    parts = _records(path, entry, ("job", "item", "event"))
    try:
        (own,) = parts["job"]
        backup = JobBackup.model_validate({"job": own, "items": parts["item"], "events": parts["event"]})
    except ValidationError as error:
        raise _invalid(path, error) from None
    except ValueError:
        raise InvalidFile("does not hold one job", where=str(path)) from None
    if backup.job.id != job:
        raise InvalidFile(f"holds job {backup.job.id}", where=str(path))
    return backup


def read_rigs(folder: Path, manifest: BackupManifest) -> list[RigRecord]:
    """Read and check the records of the rigs; raises as `import_tenant`."""
    if manifest.rig_records is None:
        return []
    path = folder / RIGS
    try:
        rigs = [RigRecord.model_validate(value) for value in _records(path, manifest.rig_records, ("rig",))["rig"]]
    except ValidationError as error:
        raise _invalid(path, error) from None
    if len({rig.name for rig in rigs}) != len(rigs) or len(rigs) != manifest.rigs:
        raise InvalidFile("two rigs have one name, or there are not as many as the manifest says", where=str(path))
    return rigs


def _records(path: Path, entry: Entry, kinds: Sequence[str]) -> dict[str, list[Any]]:
    """Read a file of records by kind; raises as `import_tenant`."""
    try:
        size = _plain(path).stat().st_size
        data = path.read_bytes() if size == entry.size else b""
    except FileNotFoundError:
        raise InvalidFile("is missing", where=str(path)) from None
    if size != entry.size or hashlib.sha256(data).hexdigest() != entry.sha256:
        raise InvalidFile("is not what the manifest says: another hash", where=str(path))
    parts: dict[str, list[Any]] = {kind: [] for kind in kinds}
    for number, line in enumerate(data.splitlines(), 1):
        try:
            ((kind, value),) = json.loads(line).items()
            parts[kind].append(value)
        except (ValueError, KeyError, AttributeError, TypeError, RecursionError):
            raise InvalidFile("is not a record of a backup", where=f"{path}: line {number}") from None
    return parts


def _lines(backup: JobBackup) -> Iterator[bytes]:
    document = backup.model_dump(mode="json")
    records = [("job", document["job"])]
    records += [("item", item) for item in document["items"]] + [("event", event) for event in document["events"]]
    for kind, value in records:
        yield _line(kind, value)


def _line(kind: str, value: Any) -> bytes:
    return json.dumps({kind: value}, separators=(",", ":")).encode() + b"\n"


def _prepare(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InvalidInput("the folder is not empty", where=str(folder), hint="Name a new one.")
        (folder / "jobs").mkdir()
        (folder / "files").mkdir()
    except OSError as error:
        raise InvalidInput(f"cannot write here: {error.strerror}", where=str(folder)) from error


def _save(store: AssetStore, tenant: str, sha256: str, folder: Path) -> None:
    data = store.get(asset_key(tenant, sha256))
    if hashlib.sha256(data).hexdigest() != sha256:
        raise InvalidFile("the store holds something else under this hash", where=asset_key(tenant, sha256))
    path = _content(folder, sha256)
    path.parent.mkdir(exist_ok=True)
    write_atomically(path, data)


def _restore(engine: sa.Engine, store: AssetStore, tenant: str, folder: Path, backup: JobBackup) -> bool:
    assets = list(backup.assets().values())
    for attempt in range(1, TRIES + 1):
        with transaction(engine, BACKUP) as conn:
            announce(conn, tenant, assets)
        for asset in assets:
            key = asset_key(tenant, asset.sha256)
            if not store.exists(key):
                store.put(key, _content(folder, asset.sha256), media_type=asset.media_type)
        try:
            with transaction(engine, BACKUP) as conn:
                return restore(conn, tenant, backup)
        except Conflict:
            if attempt == TRIES:
                raise
    raise AssertionError("the last attempt returns or raises")


def _check_content(folder: Path, sha256: str, size: int) -> None:
    path = _content(folder, sha256)
    try:
        found = _plain(path).stat().st_size
    except FileNotFoundError:
        raise InvalidFile("is missing", where=str(path)) from None
    if found != size or sha256_of(path) != sha256:
        raise InvalidFile("is not what its name says: another hash", where=str(path))


def _content(folder: Path, sha256: str) -> Path:
    return folder / "files" / sha256[:2] / sha256


def _plain(path: Path) -> Path:
    """Return a path if it is a regular file inside the backup.

    Raises:
        FileNotFoundError: there is no such file.
        InvalidFile: a link, a folder, a device.
    """
    for part in (path, path.parent):
        if part.is_symlink():
            raise InvalidFile("is a link, which a backup does not have", where=str(part))
    if path.exists() and not path.is_file():
        raise InvalidFile("is no plain file", where=str(path))
    return path


def _invalid(path: Path, error: ValidationError) -> InvalidFile:
    return InvalidFile(first_problem(error, quoted=False), where=str(path))
