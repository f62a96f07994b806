"""`marey admin keys …`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any
from uuid import UUID

import typer

from marey.cli import console
from marey.cli.database import connection, operator
from marey.cli.references import FORMS, choose, whole_id
from marey.core.errors import InvalidInput

if TYPE_CHECKING:
    import sqlalchemy as sa

    from marey.tenants import ApiKey, NewApiKey

app = typer.Typer(help="API keys.", no_args_is_help=True)

DAY = 86_400.0
COLUMNS = ("id", "name", "tenant", "scopes", "created", "last_used", "expires", "revoked", "replaced_by", "rates")

Scopes = Annotated[
    list[str] | None, typer.Option("--scope", help="read, submit, operate, admin or metrics; may be repeated.")
]
Tenant = Annotated[str, typer.Option("--tenant", help="Tenant of the key.")]
Key = Annotated[str, typer.Argument(metavar="ID", help=f"The key: {FORMS}.")]
Rates = Annotated[
    list[str] | None,
    typer.Option("--rate", help="A rate limit of this key, such as submit=60/minute (read, submit, operate, parse)."),
]


@app.command("create")
def create(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the key, such as its owner's.")],
    scopes: Scopes = None,
    tenant: Tenant = "default",
    days: Annotated[float | None, typer.Option("--days", help="Expires after so many days; default: never.")] = None,
    rates: Rates = None,
    allow_duplicate: Annotated[
        bool, typer.Option("--allow-duplicate", help="Allow a second valid key of this name without asking.")
    ] = False,
    as_json: console.Json = False,
) -> None:
    """Create a key and print it once."""
    _confirm_name(tenant, name, yes=allow_duplicate)
    with connection() as conn:
        from marey.tenants import audit, create_key

        lifetime = None if days is None else days * DAY
        chosen = scopes or ["read", "submit"]
        made = create_key(conn, name, chosen, tenant=tenant, lifetime=lifetime, rates=_rates(rates))
        audit(conn, tenant, operator(), "key.create", made.key.id, name=name, scopes=list(made.key.scopes))
    _show_secret(made, as_json)


@app.command("list")
def list_them(
    tenant: Annotated[str | None, typer.Option("--tenant", help="Only keys of this tenant.")] = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List keys without their secrets."""
    with connection() as conn:
        from marey.tenants import get_tenant, list_keys, list_tenants

        tenants = list_tenants(conn) if tenant is None else [get_tenant(conn, tenant)]
        rows = [_row(key) for each in tenants for key in list_keys(conn, each.id)]
    if as_json:
        for row in rows:
            console.result_json(row)
    else:
        columns = [column.replace("_", " ") for column in COLUMNS]
        console.table(columns, (list(row.values()) for row in rows), full_ids=full_ids)


@app.command("rotate")
def rotate(
    key: Key,
    tenant: Tenant = "default",
    hours: Annotated[
        float, typer.Option("--overlap-hours", min=0, help="Hours that the old key stays valid; 0 = none.")
    ] = 24.0,
    as_json: console.Json = False,
) -> None:
    """Replace a key by a new one and print that once."""
    with connection() as conn:
        from marey.tenants import audit, rotate_key

        wanted = find_key(conn, tenant, key)
        made = rotate_key(conn, tenant, wanted, overlap=hours * 3600)
        audit(conn, tenant, operator(), "key.rotate", wanted, new=str(made.key.id), overlap_hours=hours)
    _show_secret(made, as_json)
    if not as_json:
        console.say(f"The old one works for {hours:g} hours." if hours else "The old one is invalid from now on.")


@app.command("revoke")
def revoke(key: Key, tenant: Tenant = "default") -> None:
    """Revoke a key immediately."""
    with connection() as conn:
        from marey.tenants import audit, revoke_key

        wanted = find_key(conn, tenant, key)
        revoked = revoke_key(conn, tenant, wanted)
        audit(conn, tenant, operator(), "key.revoke", wanted, name=revoked.name)
    console.say(f"revoked key {console.short_id(str(wanted))} {revoked.name!r}")


def find_key(conn: sa.Connection, tenant: str | None, key: str) -> UUID:
    """Resolve a reference to a key of a tenant, or for None of any tenant; raises as `marey.cli.references.find`."""
    from marey.takes import ReferenceKind, resolve_reference
    from marey.tenants import list_tenants

    if (identifier := whole_id(key)) is not None:
        return UUID(identifier)
    tenants = [each.id for each in list_tenants(conn)] if tenant is None else [tenant]
    found = [match for each in tenants for match in resolve_reference(conn, each, ReferenceKind.KEY, key)]
    return UUID(choose("key", key, [{**vars(each), "created": each.created.isoformat()} for each in found]).id)


def _confirm_name(tenant: str, name: str, *, yes: bool) -> None:
    """Ask before a second key gets a name: audit log, reviews and limits name keys by it.

    Raises:
        InvalidInput: the name is in use, and there is no terminal to ask at.
    """
    if yes:
        return
    with connection() as conn:
        from marey.tenants import keys_named

        taken = keys_named(conn, tenant, name)
    if taken:
        taken_name = f"a valid key of tenant {tenant} is already named {name!r} (id {taken[0].id})"
        if not console.can_ask():
            raise InvalidInput(
                taken_name,
                hint="--allow-duplicate makes another one of that name; `marey admin keys rotate ID` replaces it.",
            )
        console.confirm(f"{taken_name[0].upper()}{taken_name[1:]}. Create another one?", yes=False)


def _show_secret(made: NewApiKey, as_json: bool) -> None:
    key = made.key
    if as_json:
        expires = key.expires and key.expires.isoformat()
        row = {"id": str(key.id), "secret": made.secret, "tenant": key.tenant, "scopes": list(key.scopes)}
        console.result_json({**row, "expires": expires})
    else:
        console.result(made.secret)
        console.say(f"{key.name}: {', '.join(key.scopes)}. It is shown only now; put it into MAREY_KEY.")


def _row(key: ApiKey) -> dict[str, Any]:
    return {
        "id": str(key.id),
        "name": key.name,
        "tenant": key.tenant,
        "scopes": ",".join(key.scopes),
        "created": key.created.isoformat(),
        "last_used": key.last_used and key.last_used.isoformat(),
        "expires": key.expires and key.expires.isoformat(),
        "revoked": key.revoked and key.revoked.isoformat(),
        "replaced_by": key.replaced_by and str(key.replaced_by),
        "rates": ",".join(f"{kind}={rate}" for kind, rate in sorted(key.rates.items())),
    }


def _rates(given: list[str] | None) -> dict[str, str]:
    rates: dict[str, str] = {}
    for each in given or ():
        kind, separator, rate = each.partition("=")
        if not separator:
            raise InvalidInput(f"{each!r} is not a rate limit", where="--rate", hint="Write submit=60/minute.")
        rates[kind] = rate
    return rates
