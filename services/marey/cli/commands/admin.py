"""`marey admin …` and `marey doctor`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marey.cli import console
from marey.cli.commands import backup, keys, tenants
from marey.cli.commands.keys import find_key
from marey.cli.database import connection, engine_of, operator, settings_here
from marey.cli.references import FORMS

if TYPE_CHECKING:
    import sqlalchemy as sa

    from marey.tenants import AuditRow

app = typer.Typer(help="For the operator of a server, beside its database.", no_args_is_help=True)
app.add_typer(tenants.app, name="tenants")
app.add_typer(keys.app, name="keys")
app.command("export")(backup.export)
app.command("import")(backup.import_)

AUDIT_COLUMNS = ("at", "tenant", "actor", "key", "verb", "target", "data")


@app.command()
def migrate() -> None:
    """Bring the database to the newest revision, and create the bucket of an S3 store if it is missing."""
    config = settings_here()
    from marey.db import upgrade
    from marey.storage import open_store

    upgrade(engine_of(config))
    console.say("the database is at the newest revision")
    store = open_store(config)
    store.prepare()
    store.check()
    console.say("the asset store takes files")


@app.command()
def gc(as_json: console.Json = False) -> None:
    """Remove stored files that are no longer referenced."""
    config = settings_here()
    from marey.db import transaction
    from marey.storage import open_store
    from marey.takes import collect_garbage
    from marey.tenants import DEFAULT_TENANT, audit

    engine = engine_of(config)
    report = collect_garbage(engine, open_store(config))
    with transaction(engine) as conn:
        removed = {"rows": report.rows, "orphans": report.orphans, "missing": len(report.missing)}
        audit(conn, DEFAULT_TENANT, operator(), "store.gc", "assets", **removed)
    engine.dispose()
    if as_json:
        console.result_json({"rows": report.rows, "orphans": report.orphans, "missing": list(report.missing)})
    else:
        console.say(f"{report.rows} files without a motion and {report.orphans} without a row were removed")
    for lost in report.missing:
        console.say(f"lost: the database names {lost}, but the store does not have it")
    if report.missing:
        raise typer.Exit(1)


@app.command()
def audit(
    tenant: Annotated[str | None, typer.Option("--tenant", help="Only entries of this tenant.")] = None,
    key: Annotated[str | None, typer.Option("--key", help=f"Only entries of this key: {FORMS}.")] = None,
    verb: Annotated[
        str | None, typer.Option("--verb", help="Only this action, such as job.cancel, or a noun, such as job.")
    ] = None,
    days: Annotated[float | None, typer.Option("--days", min=0, help="Only entries of the last so many days.")] = None,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """Show the audit log, newest first: by name of the key, or by the operating-system user of `marey admin`."""
    since = None if days is None else datetime.now(UTC) - timedelta(days=days)
    with connection() as conn:
        wanted = None if key is None else find_key(conn, tenant, key)
        found = _audited(conn, console.page_size(limit), tenant=tenant, key=wanted, verb=verb, since=since)
        rows = map(_audit_row, found)
        console.listing(rows, AUDIT_COLUMNS, _audit_cell, as_json=as_json, limit=limit, full_ids=full_ids)


def doctor(as_json: console.Json = False) -> None:
    """Check this machine and what its server needs, and say what to do. Exits 1 if something is bad.

    What is installed, home and disk, server, database, clock, workers, scheduler, queue, store, models, texts, device.
    """
    from marey.cli.doctor import check_all

    bad = False
    for check in check_all():
        bad = bad or check.state == "bad"
        if as_json:
            console.result_json(vars(check))
        else:
            console.result(f"{check.state:<5} {check.name:<14} {check.message}")
            if check.hint:
                console.result(f"{'':<20} → {check.hint}")
    sys.stdout.flush()
    if bad:
        raise typer.Exit(1)


def _audited(conn: sa.Connection, size: int, **which: Any) -> Iterator[AuditRow]:
    """The rows, newest first, `size` at a time."""
    from marey.tenants import list_audit

    cursor: str | None = None
    while True:
        page = list_audit(conn, cursor=cursor, limit=size, **which)
        yield from page.rows
        cursor = page.cursor
        if cursor is None:
            return


def _audit_row(row: AuditRow) -> dict[str, Any]:
    own = {"id": str(row.id), "at": row.at.isoformat(), "key": row.key and str(row.key), "data": dict(row.data)}
    return {**own, "tenant": row.tenant, "actor": row.actor, "verb": row.verb, "target": row.target}


def _audit_cell(row: dict[str, Any], column: str) -> object:
    if column == "data":
        return ", ".join(f"{name}={value}" for name, value in row["data"].items())
    return row[column]
