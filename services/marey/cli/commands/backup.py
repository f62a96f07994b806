"""`marey admin export` and `import`: a tenant's jobs, motions, rigs and files as a folder, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from marey.cli import console
from marey.cli.database import engine_of, operator, settings_here

if TYPE_CHECKING:
    import sqlalchemy as sa

    from marey.cli.backup import BackupManifest, Restored

Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the backup.")]
Tenant = Annotated[str, typer.Option("--tenant", help="Tenant of the jobs.")]


def export(folder: Folder, tenant: Tenant = "default", as_json: console.Json = False) -> None:
    """Back up every job that has ended, with its motions and files, and every rig, into a new folder."""
    config = settings_here()
    from marey.cli.backup import Restored, export_tenant
    from marey.storage import open_store

    engine = engine_of(config)
    manifest, running = export_tenant(engine, open_store(config), tenant, folder)
    written = Restored(len(manifest.jobs), manifest.rigs)
    _note(engine, tenant, "tenant.export", manifest, written)
    _tell(manifest, as_json, written)
    if running:
        console.say(f"{running} jobs have not ended and are not in it; back them up later.")


def import_(folder: Folder, tenant: Tenant = "default", as_json: console.Json = False) -> None:
    """Verify a backup with all its hashes, then restore the jobs and rigs that do not exist."""
    config = settings_here()
    from marey.cli.backup import import_tenant
    from marey.storage import open_store

    engine = engine_of(config)
    manifest, written = import_tenant(engine, open_store(config), tenant, folder)
    _note(engine, tenant, "tenant.import", manifest, written)
    _tell(manifest, as_json, written)


def _note(engine: sa.Engine, tenant: str, verb: str, manifest: BackupManifest, written: Restored) -> None:
    from marey.db import transaction
    from marey.tenants import audit

    with transaction(engine) as conn:
        audit(conn, tenant, operator(), verb, tenant, **written._asdict(), files=manifest.files)
    engine.dispose()


def _tell(manifest: BackupManifest, as_json: bool, written: Restored) -> None:
    if as_json:
        document = manifest.model_dump(mode="json", exclude={"jobs", "rig_records"})
        counts = {"jobs": len(manifest.jobs), "written": written.jobs, "rigs_written": written.rigs}
        console.result_json({**document, **counts})
        return
    size = f"{manifest.bytes / 2**20:.1f} MiB"
    jobs, rigs = len(manifest.jobs) - written.jobs, manifest.rigs - written.rigs
    there = [f"{count} {noun}" for count, noun in ((jobs, "jobs"), (rigs, "rigs")) if count]
    more = f"; {' and '.join(there)} were there already" if there else ""
    wrote = f"{written.jobs} jobs of {manifest.items} items in all, {written.rigs} rigs"
    console.say(f"{wrote}, {manifest.files} files, {size}{more}")
