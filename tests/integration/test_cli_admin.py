"""`marey admin` beside a real database. In this process: a process each would take long."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from typer.testing import _NamedTextIOWrapper

from marey.core.errors import Unauthenticated
from marey.core.settings import settings
from marey.db import transaction
from marey.tenants import authenticate
from tests.servers.jobs import submit_items
from tests.support.command import Command
from tests.support.marey import Ran


class Admin:
    """The command line of an operator."""

    def __call__(self, *arguments: object, stdin: str = "") -> Ran:
        """Run `marey admin …` to its end."""
        return Command({})("admin", *arguments, stdin=stdin)

    def json(self, *arguments: object) -> list[dict[str, Any]]:
        """Output of a command as JSON lines."""
        return [json.loads(line) for line in self(*arguments, "--json").ok().out.splitlines()]


@pytest.fixture
def admin(database_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Admin]:
    monkeypatch.setenv("MAREY_DATABASE_URL", database_url)
    monkeypatch.setenv("MAREY_HOME", str(tmp_path))
    settings.cache_clear()
    yield Admin()
    settings.cache_clear()


def test_a_tenant_is_made_shown_changed_suspended_and_reinstated(admin: Admin, engine: sa.Engine) -> None:
    (made,) = admin.json("tenants", "create", "studio", "--queued", 100, "--bytes", "500G")
    assert made["quotas"] == {"queued": 100, "running": None, "bytes": 500 * 2**30, "streams": None}
    submit_items(engine, 7, tenant="studio")
    assert "7 of 100" in admin("tenants", "show", "studio").ok().out
    admin("tenants", "set", "studio", "--queued", "none", "--running", 8, "--streams", 2).ok()
    (row,) = [row for row in admin.json("tenants", "list") if row["id"] == "studio"]
    assert row["quotas"] == {"queued": None, "running": 8, "bytes": 500 * 2**30, "streams": 2}
    assert (row["used"]["queued"], row["suspended"]) == (7, None)
    admin("tenants", "suspend", "studio", "--reason", "unpaid").ok()
    assert admin.json("tenants", "show", "studio")[0]["suspended"] is not None
    admin("tenants", "reinstate", "studio").ok()
    assert admin.json("tenants", "show", "studio")[0]["suspended"] is None
    told = [(row["verb"], row["data"]) for row in admin.json("audit", "--tenant", "studio")]
    assert [verb for verb, _ in told] == ["tenant.reinstate", "tenant.suspend", "tenant.set", "tenant.create"]
    assert told[1][1] == {"reason": "unpaid"}


def test_what_cannot_be_is_refused_and_says_what_can(admin: Admin) -> None:
    admin("tenants", "create", "Studio X").refused(2, "tenant name")
    admin("tenants", "create", "default").refused(2, "already")
    admin("tenants", "show", "nobody").refused(3, "marey admin tenants list")
    admin("tenants", "set", "default").refused(2, "--queued")
    admin("tenants", "set", "default", "--queued", "many").refused(2, "--queued", "whole number")
    admin("tenants", "set", "default", "--bytes", "5 light years").refused(2, "500G")
    admin("tenants", "set", "default", "--running", 2**40).refused(2, "running")
    admin("keys", "create", "ci", "--tenant", "nobody").refused(3, "tenant nobody")
    admin("keys", "create", "ci", "--rate", "submit").refused(2, "submit=60/minute")
    admin("keys", "create", "ci", "--days", "-1").refused(2, "lifetime")
    admin("keys", "rotate", "x").refused(3, "marey admin keys list")
    admin("audit", "--key", "x").refused(3, "marey admin keys list")


def test_a_key_of_a_tenant_is_made_rotated_and_revoked(admin: Admin, engine: sa.Engine) -> None:
    admin("tenants", "create", "studio").ok()
    wanted = ("ci", "--tenant", "studio", "--scope", "read", "--days", 30, "--rate", "read=60/minute")
    (made,) = admin.json("keys", "create", *wanted)
    with transaction(engine) as conn:
        key = authenticate(conn, made["secret"])
    assert (key.tenant, key.scopes, key.rates) == ("studio", ("read",), {"read": "60/minute"})
    assert key.expires is not None
    rotated = admin("keys", "rotate", key.id, "--tenant", "studio", "--overlap-hours", 1).ok()
    with transaction(engine) as conn:
        new = authenticate(conn, rotated.out.strip())
        assert authenticate(conn, made["secret"]).replaced_by == new.id
    assert {row["id"] for row in admin.json("keys", "list", "--tenant", "studio")} == {str(key.id), str(new.id)}
    assert admin.json("keys", "list", "--tenant", "default") == []
    admin("keys", "revoke", key.id, "--tenant", "studio").ok()
    with transaction(engine) as conn, pytest.raises(Unauthenticated):
        authenticate(conn, made["secret"])
    verbs = [row["verb"] for row in admin.json("audit", "--verb", "key")]
    assert verbs == ["key.revoke", "key.rotate", "key.create"]
    told = admin("audit").ok().out
    assert all(secret not in told for secret in (made["secret"], rotated.out.strip()))


def test_a_name_in_use_is_asked_about_at_a_terminal_and_refused_elsewhere(
    admin: Admin, monkeypatch: pytest.MonkeyPatch
) -> None:
    (first,) = admin.json("keys", "create", "ci")
    refused = admin("keys", "create", "ci").refused(2, "already named 'ci'", first["id"], "--allow-duplicate")
    assert "?" not in refused.err
    admin("tenants", "create", "studio").ok()
    (other,) = admin.json("keys", "create", "ci", "--tenant", "studio")  # of another tenant: no duplicate
    assert len(admin.json("keys", "list")) == 2
    (second,) = admin.json("keys", "create", "ci", "--allow-duplicate")
    with monkeypatch.context() as terminal:
        terminal.setattr(_NamedTextIOWrapper, "isatty", lambda _: True)
        admin("keys", "create", "ci", stdin="n\n").refused(130, "Create another one?", "nothing was done")
        admin("keys", "create", "ci", stdin="y\n").ok()
    assert len(admin.json("keys", "list", "--tenant", "default")) == 3
    for each in admin.json("keys", "list", "--tenant", "default"):
        admin("keys", "revoke", each["id"]).ok()
    (third,) = admin.json("keys", "create", "ci")  # a revoked key does not keep its name
    assert len({first["id"], other["id"], second["id"], third["id"]}) == 4


def test_the_audit_log_is_listed_by_tenant_verb_and_time_and_to_its_limit(admin: Admin, engine: sa.Engine) -> None:
    for number in range(5):
        admin("tenants", "create", f"studio-{number}").ok()
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE audit_event SET at = at - interval '3 days' WHERE target = 'studio-0'"))
    assert [row["target"] for row in admin.json("audit", "--limit", 2)] == ["studio-4", "studio-3"]
    assert len(admin.json("audit", "--days", 2)) == 4
    assert [row["target"] for row in admin.json("audit", "--tenant", "studio-1", "--verb", "tenant.create")] == [
        "studio-1"
    ]
    assert admin.json("audit", "--verb", "ten") == []


def test_a_garbage_collection_is_on_record(admin: Admin) -> None:
    assert admin.json("gc") == [{"rows": 0, "orphans": 0, "missing": []}]
    (row,) = admin.json("audit")
    assert (row["verb"], row["data"]) == ("store.gc", {"rows": 0, "orphans": 0, "missing": 0})
    assert row["actor"].startswith("marey admin (")
