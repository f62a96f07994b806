"""`marey admin export` and `import`: a tenant's jobs, motions and files as a folder, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from marey.cli import console
from marey.cli.database import engine_of, operator, settings_here

if TYPE_CHECKING:
    import sqlalchemy as sa

    from marey.cli.backup import BackupManifest

Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the backup.")]
Tenant = Annotated[str, typer.Option("--tenant", help="Tenant of the jobs.")]


def export(folder: Folder, tenant: Tenant = "default", as_json: console.Json = False) -> None:
    """Back up every job that has ended, with its motions and files, into a new folder."""
    config = settings_here()
    from marey.cli.backup import export_tenant
    from marey.storage import open_store

    engine = engine_of(config)
    manifest, running = export_tenant(engine, open_store(config), tenant, folder)
    _note(engine, tenant, "tenant.export", manifest, len(manifest.jobs))
    _tell(manifest, as_json, written=len(manifest.jobs))
    if running:
        console.say(f"{running} jobs have not ended and are not in it; back them up later.")


def import_(folder: Folder, tenant: Tenant = "default", as_json: console.Json = False) -> None:
    """Verify a backup with all its hashes, then restore the jobs that do not exist."""
    config = settings_here()
    from marey.cli.backup import import_tenant
    from marey.storage import open_store

    engine = engine_of(config)
    manifest, written = import_tenant(engine, open_store(config), tenant, folder)
    _note(engine, tenant, "tenant.import", manifest, written)
    _tell(manifest, as_json, written=written)


def _note(engine: sa.Engine, tenant: str, verb: str, manifest: BackupManifest, jobs: int) -> None:
    from marey.db import transaction
    from marey.tenants import audit

    with transaction(engine) as conn:
        audit(conn, tenant, operator(), verb, tenant, jobs=jobs, files=manifest.files)
    engine.dispose()


def _tell(manifest: BackupManifest, as_json: bool, *, written: int) -> None:
    if as_json:
        document = manifest.model_dump(mode="json", exclude={"jobs"})
        console.result_json({**document, "jobs": len(manifest.jobs), "written": written})
        return
    size = f"{manifest.bytes / 2**20:.1f} MiB"
    there = len(manifest.jobs) - written
    more = f"; {there} jobs were there already" if there else ""
    console.say(f"{written} jobs of {manifest.items} items in all, {manifest.files} files, {size}{more}")
