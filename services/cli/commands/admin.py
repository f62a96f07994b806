"""`marey admin …` and `marey doctor`."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from services.cli import console
from shared.errors import InvalidInput

if TYPE_CHECKING:
    import sqlalchemy as sa

    from shared.settings import Settings

app = typer.Typer(help="For the operator of a server, beside its database.", no_args_is_help=True)
keys = typer.Typer(help="API keys.", no_args_is_help=True)
app.add_typer(keys, name="keys")

Scopes = Annotated[list[str] | None, typer.Option("--scope", help="read, submit, operate or admin; may be repeated.")]


@app.command()
def migrate() -> None:
    """Bring the database to the newest revision, and make the bucket of an S3 store where there is none."""
    config = _settings()
    from shared.jobs import upgrade
    from shared.storage import open_store

    upgrade(_engine(config))
    console.say("the database is at the newest revision")
    store = open_store(config)
    store.prepare()
    store.check()
    console.say("the asset store takes files")


@app.command()
def gc(as_json: console.Json = False) -> None:
    """Remove stored files that nothing refers to."""
    config = _settings()
    from shared.jobs import collect_garbage
    from shared.storage import open_store

    report = collect_garbage(_engine(config), open_store(config))
    if as_json:
        console.result_json({"rows": report.rows, "orphans": report.orphans, "missing": list(report.missing)})
    else:
        console.say(f"{report.rows} files without a motion and {report.orphans} without a row were removed")
    for lost in report.missing:
        console.say(f"lost: the database names {lost}, but the store does not have it")
    if report.missing:
        raise typer.Exit(1)


@keys.command("create")
def create(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Whose key it is.")],
    scopes: Scopes = None,
    as_json: console.Json = False,
) -> None:
    """Make a key and print it, this once."""
    config = _settings()
    from shared.jobs import create_key, transaction

    with transaction(_engine(config)) as conn:
        made = create_key(conn, name, scopes or ["read", "submit"])
    if as_json:
        console.result_json({"id": str(made.key.id), "secret": made.secret, "scopes": list(made.key.scopes)})
    else:
        console.result(made.secret)
        console.say(f"{name}: {', '.join(made.key.scopes)}. It is shown only now; put it into MAREY_KEY.")


@keys.command("list")
def list_them(as_json: console.Json = False) -> None:
    """List keys, without their secrets."""
    config = _settings()
    from shared.jobs import DEFAULT_TENANT, list_keys, transaction

    with transaction(_engine(config)) as conn:
        found = list_keys(conn, DEFAULT_TENANT)
    rows = [
        {
            "id": str(key.id),
            "name": key.name,
            "scopes": ",".join(key.scopes),
            "created": key.created.isoformat(),
            "last_used": key.last_used and key.last_used.isoformat(),
            "revoked": key.revoked and key.revoked.isoformat(),
        }
        for key in found
    ]
    if as_json:
        for row in rows:
            console.result_json(row)
    else:
        console.table(("id", "name", "scopes", "created", "last used", "revoked"), (list(row.values()) for row in rows))


@keys.command("revoke")
def revoke(key: Annotated[str, typer.Argument(metavar="ID", help="Id of the key.")]) -> None:
    """Make a key invalid from now on."""
    from uuid import UUID

    try:
        wanted = UUID(key)
    except ValueError:
        raise InvalidInput(f"{key!r} is not the id of a key", hint="`marey admin keys list` shows them.") from None
    config = _settings()
    from shared.jobs import DEFAULT_TENANT, revoke_key, transaction

    with transaction(_engine(config)) as conn:
        console.say(f"{revoke_key(conn, DEFAULT_TENANT, wanted).name} is revoked")


def doctor(as_json: console.Json = False) -> None:
    """Check this machine: what is installed, the server, the models. Exits 1 if something is broken."""
    from services.cli.checkup import check_all

    broken = False
    for check in check_all():
        broken = broken or check.state == "broken"
        if as_json:
            console.result_json(vars(check))
        else:
            console.result(f"{check.state:<8} {check.name:<12} {check.message}")
    sys.stdout.flush()
    if broken:
        raise typer.Exit(1)


def _settings() -> Settings:
    """The settings; those of the embedded server of this home where no database is named.

    Raises:
        InvalidInput: the extra `server` is not installed.
    """
    from services.cli.roles import needs_extra

    try:
        from shared.runtime.embedded import postgres_url
        from shared.settings import settings
    except ImportError as error:
        raise needs_extra("server", error) from error
    from pydantic import SecretStr

    config = settings()
    if config.database_url is not None:
        return config
    return config.model_copy(update={"database_url": SecretStr(postgres_url(config.home.absolute()))})


def _engine(config: Settings) -> sa.Engine:
    from shared.jobs import create_engine

    if config.database_url is None:
        raise AssertionError("_settings fills it")
    return create_engine(config.database_url.get_secret_value(), pool_size=2)
