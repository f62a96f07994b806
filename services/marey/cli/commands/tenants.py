"""`marey admin tenants …`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marey.cli import console
from marey.cli.database import connection, operator
from marey.core.errors import InvalidInput

if TYPE_CHECKING:
    import sqlalchemy as sa

    from marey.tenants import TenantRow

app = typer.Typer(help="Tenants of this server and their quotas.", no_args_is_help=True)

NONE = "none"
UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
COLUMNS = ("id", "suspended", "queued", "running", "bytes", "streams")

Name = Annotated[str, typer.Argument(metavar="TENANT", help="Its name.")]
Queued = Annotated[
    str | None, typer.Option("--queued", help="Quota of items in the queue, running ones included; `none` = unlimited.")
]
Running = Annotated[str | None, typer.Option("--running", help="Quota of items running at once.")]
Bytes = Annotated[str | None, typer.Option("--bytes", help="Quota of bytes in the asset store, such as 500G.")]
Streams = Annotated[
    str | None, typer.Option("--streams", help="Quota of open live streams per key; `none` = MAREY_STREAMS_PER_KEY.")
]


@app.command("create")
def create(
    tenant: Name,
    queued: Queued = None,
    running: Running = None,
    size: Bytes = None,
    streams: Streams = None,
    as_json: console.Json = False,
) -> None:
    """Create a tenant; quotas default to none."""
    chosen = _chosen(queued, running, size, streams)
    with connection() as conn:
        from marey.tenants import Quotas, audit, create_tenant

        row = create_tenant(conn, tenant, Quotas(**chosen))
        audit(conn, tenant, operator(), "tenant.create", tenant, **chosen)
        shown = _view(conn, row)
    _report(shown, f"{tenant} was created. A key: `marey admin keys create NAME --tenant {tenant}`.", as_json)


@app.command("list")
def list_them(as_json: console.Json = False) -> None:
    """List tenants with quotas and usage."""
    with connection() as conn:
        from marey.tenants import list_tenants

        views = [_view(conn, row) for row in list_tenants(conn)]
    if as_json:
        for view in views:
            console.result_json(view)
        return
    console.table(COLUMNS, ((view["id"], view["suspended"], *_used(view).values()) for view in views))


@app.command("show")
def show(tenant: Name, as_json: console.Json = False) -> None:
    """Show a tenant with its quotas and usage."""
    with connection() as conn:
        from marey.tenants import get_tenant

        view = _view(conn, get_tenant(conn, tenant))
    if as_json:
        console.result_json(view)
        return
    rows = {"tenant": view["id"], "created": view["created"], "suspended": view["suspended"], **_used(view)}
    for name, value in rows.items():
        if value is not None:
            console.result(f"{name:<10} {value}")


@app.command("set")
def change(
    tenant: Name,
    queued: Queued = None,
    running: Running = None,
    size: Bytes = None,
    streams: Streams = None,
    as_json: console.Json = False,
) -> None:
    """Change the given quotas. Existing usage beyond a new quota stays."""
    chosen = _chosen(queued, running, size, streams)
    if not chosen:
        raise InvalidInput(
            "no quota is given", hint="--queued, --running, --bytes or --streams; `none` takes one away."
        )
    with connection() as conn:
        from marey.tenants import audit, set_quotas

        row = set_quotas(conn, tenant, chosen)
        audit(conn, tenant, operator(), "tenant.set", tenant, **{name: value or NONE for name, value in chosen.items()})
        shown = _view(conn, row)
    _report(shown, f"{tenant}: {_in_words(shown)}", as_json)


@app.command("suspend")
def suspend(
    tenant: Name,
    reason: Annotated[str | None, typer.Option("--reason", help="For the audit log.")] = None,
) -> None:
    """Refuse a tenant's requests and start none of its items; running items are finished."""
    with connection() as conn:
        from marey.tenants import audit, suspend_tenant

        suspend_tenant(conn, tenant)
        audit(conn, tenant, operator(), "tenant.suspend", tenant, reason=reason)
    console.say(f"{tenant} is suspended. `marey admin tenants reinstate {tenant}` ends that.")


@app.command("reinstate")
def reinstate(tenant: Name) -> None:
    """End a suspension; the tenant's jobs resume."""
    with connection() as conn:
        from marey.tenants import audit, reinstate_tenant

        reinstate_tenant(conn, tenant)
        audit(conn, tenant, operator(), "tenant.reinstate", tenant)
    console.say(f"{tenant} is active again")


def _chosen(queued: str | None, running: str | None, size: str | None, streams: str | None) -> dict[str, int | None]:
    given = {"queued": queued, "running": running, "bytes": size, "streams": streams}
    return {name: _quota(name, text) for name, text in given.items() if text is not None}


def _quota(name: str, text: str) -> int | None:
    """Read a quota: a number, which may have a unit for bytes, or `none`.

    Raises:
        InvalidInput: it is neither.
    """
    if text == NONE:
        return None
    form = (
        re.fullmatch(r"([0-9]{1,18})([KMGT]?)(?:i?B)?", text) if name == "bytes" else re.fullmatch(r"([0-9]+)()", text)
    )
    if form is None:
        example = "Write 500G, or `none`." if name == "bytes" else "Write a whole number, or `none`."
        raise InvalidInput(f"{text[:40]!r} is not a quota", where=f"--{name}", hint=example)
    return int(form[1]) * UNITS[form[2]]


def _view(conn: sa.Connection, row: TenantRow) -> dict[str, Any]:
    from marey.tenants import usage

    return {
        "id": row.id,
        "created": row.created.isoformat(),
        "suspended": row.suspended and row.suspended.isoformat(),
        "quotas": vars(row.quotas),
        "used": vars(usage(conn, row.id)),
    }


def _used(view: dict[str, Any]) -> dict[str, str]:
    """Describe the usage of each quota."""
    used, quotas = view["used"], view["quotas"]
    words = {
        "queued": f"{used['queued']}",
        "running": f"{used['running']}",
        "bytes": f"{console.size(used['bytes'])} (+{console.size(used['expected'])} expected)",
        "streams": f"{used['streams']}",
    }
    limits = {"bytes": quotas["bytes"] and console.size(quotas["bytes"]), "streams": _of_a_key(quotas["streams"])}
    return {
        name: text if quotas[name] is None else f"{text} of {limits.get(name, quotas[name])}"
        for name, text in words.items()
    }


def _in_words(view: dict[str, Any]) -> str:
    return ", ".join(f"{name} {text}" for name, text in _used(view).items())


def _of_a_key(limit: int | None) -> str | None:
    return None if limit is None else f"{limit} a key"


def _report(view: dict[str, Any], words: str, as_json: bool) -> None:
    if as_json:
        console.result_json(view)
    else:
        console.say(words)
