"""API keys: what opens, how long, and what is kept of them."""

from __future__ import annotations

from collections.abc import Callable
from uuid import UUID, uuid4

import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput, NotFound, Refused, Unauthenticated
from marey.db import transaction
from marey.tenants import (
    SCOPES,
    authenticate,
    check_key,
    create_key,
    keys_named,
    list_keys,
    revoke_key,
    rotate_key,
    suspend_tenant,
)
from tests.servers.jobs import new_tenant

DAY = 86_400.0


def test_a_key_opens_until_it_is_revoked(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        made = create_key(conn, "ci", {"submit", "read"})
        key = authenticate(conn, made.secret)
        assert (key.id, key.tenant, key.scopes, key.name) == (made.key.id, "default", ("read", "submit"), "ci")
        assert key.last_used is not None
        assert revoke_key(conn, "default", key.id).revoked is not None
        with pytest.raises(Unauthenticated, match="revoked"):
            authenticate(conn, made.secret)
        assert [row.id for row in list_keys(conn, "default")] == [key.id]


def test_a_key_that_is_revoked_again_keeps_the_time_of_the_first(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        key = create_key(conn, "ci", {"read"}).key.id
        first = revoke_key(conn, "default", key).revoked
    with transaction(engine) as conn:
        assert revoke_key(conn, "default", key).revoked == first


def test_the_secret_is_stored_nowhere(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        made = create_key(conn, "ci", {"read"})
        row = str(conn.execute(sa.text("SELECT row_to_json(api_key)::text FROM api_key")).scalar_one())
    assert made.secret.rpartition("_")[2] not in row
    assert made.secret not in repr(made.key)


@pytest.mark.parametrize("change", [lambda s: s[:-1] + ("A" if s[-1] != "A" else "B"), lambda s: s[:-1], str.upper])
def test_a_wrong_secret_opens_nothing(engine: sa.Engine, change: Callable[[str], str]) -> None:
    with transaction(engine) as conn:
        made = create_key(conn, "ci", {"read"})
        with pytest.raises(Unauthenticated):
            authenticate(conn, change(made.secret))


def test_a_key_needs_known_scopes_and_a_tenant(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        for scopes in ({"root"}, set[str]()):
            with pytest.raises(InvalidInput, match="scope"):
                create_key(conn, "ci", scopes)
        with pytest.raises(NotFound, match="tenant"):
            create_key(conn, "ci", {"read"}, tenant="studio")
        with pytest.raises(NotFound):
            revoke_key(conn, "default", uuid4())


def pass_time(engine: sa.Engine, seconds: float, key: UUID) -> None:
    """As if a key had been made, used and given its end so much earlier."""
    with transaction(engine) as conn:
        shift = "make_interval(secs => :seconds)"
        query = (
            f"UPDATE api_key SET created_at = created_at - {shift}, last_used_at = last_used_at - {shift}, "
            f"expires_at = expires_at - {shift} WHERE id = :key"
        )
        conn.execute(sa.text(query), {"seconds": seconds, "key": key})


def test_a_key_expires_at_the_end_of_its_life(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        made = create_key(conn, "ci", {"read"}, lifetime=2 * DAY)
    pass_time(engine, DAY, made.key.id)
    with transaction(engine) as conn:
        assert authenticate(conn, made.secret).id == made.key.id
    pass_time(engine, DAY, made.key.id)
    with transaction(engine) as conn:
        with pytest.raises(Unauthenticated, match="expired on"):
            authenticate(conn, made.secret)
        with pytest.raises(Unauthenticated, match="expired on"):
            check_key(conn, made.key.id)


def test_a_key_that_no_longer_opens_is_named_by_its_public_part(engine: sa.Engine) -> None:
    """By that the operator finds it in the list, and its secret is not shown."""
    with transaction(engine) as conn:
        expired, revoked, unknown = (create_key(conn, name, {"read"}, lifetime=DAY) for name in "abc")
        revoke_key(conn, "default", revoked.key.id)
    pass_time(engine, 2 * DAY, expired.key.id)
    wrong = unknown.secret[:-1] + ("A" if unknown.secret[-1] != "A" else "B")
    with transaction(engine) as conn:
        for made, secret in ((expired, expired.secret), (revoked, revoked.secret), (unknown, wrong)):
            with pytest.raises(Unauthenticated) as refused:
                authenticate(conn, secret)
            assert refused.value.where == f"marey_{made.key.prefix}_…"
            assert "keys create" in (refused.value.hint or "")
            assert secret.rpartition("_")[2] not in str(refused.value)


@pytest.mark.parametrize("lifetime", [0.0, -1.0, float("nan"), 1e12])
def test_a_life_that_cannot_be_is_refused(engine: sa.Engine, lifetime: float) -> None:
    with transaction(engine) as conn, pytest.raises(InvalidInput, match="lifetime"):
        create_key(conn, "ci", {"read"}, lifetime=lifetime)


def test_a_rotated_key_works_beside_its_successor_for_the_overlap(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        old = create_key(conn, "ci", {"read", "submit"}, lifetime=90 * DAY, rates={"read": "5/second"})
    pass_time(engine, 30 * DAY, old.key.id)
    with transaction(engine) as conn:
        new = rotate_key(conn, "default", old.key.id, overlap=DAY)
        assert (new.key.name, new.key.scopes, new.key.rates) == ("ci", ("read", "submit"), {"read": "5/second"})
        assert new.key.expires is not None
        assert (new.key.expires - new.key.created).total_seconds() == pytest.approx(90 * DAY, abs=60)
        assert authenticate(conn, old.secret).replaced_by == new.key.id
        assert authenticate(conn, new.secret).id == new.key.id
        with pytest.raises(Conflict, match=f"rotated to {new.key.id}"):
            rotate_key(conn, "default", old.key.id)
    pass_time(engine, DAY + 1, old.key.id)
    with transaction(engine) as conn:
        with pytest.raises(Unauthenticated, match="expired"):
            authenticate(conn, old.secret)
        assert authenticate(conn, new.secret).id == new.key.id


def test_an_overlap_never_lengthens_a_life_and_none_ends_it(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        short, unending = create_key(conn, "a", {"read"}, lifetime=60), create_key(conn, "b", {"read"})
        rotate_key(conn, "default", short.key.id, overlap=DAY)
        assert authenticate(conn, short.secret).expires == short.key.expires
        assert rotate_key(conn, "default", unending.key.id, overlap=0).key.expires is None
        with pytest.raises(Unauthenticated, match="expired"):
            authenticate(conn, unending.secret)


def test_only_a_valid_key_of_the_tenant_can_be_rotated(engine: sa.Engine) -> None:
    new_tenant(engine, "studio")
    with transaction(engine) as conn:
        revoked, expired = create_key(conn, "a", {"read"}).key, create_key(conn, "b", {"read"}, lifetime=1).key
        revoke_key(conn, "default", revoked.id)
    pass_time(engine, 2, expired.id)
    with transaction(engine) as conn:
        for key, why in ((revoked, "is revoked"), (expired, "has expired")):
            with pytest.raises(Conflict, match=why):
                rotate_key(conn, "default", key.id)
        for tenant, key in (("studio", revoked.id), ("default", uuid4())):
            with pytest.raises(NotFound):
                rotate_key(conn, tenant, key)
        with pytest.raises(InvalidInput, match="overlap"):
            rotate_key(conn, "default", revoked.id, overlap=-1)


def test_the_use_of_a_key_is_written_once_a_minute_and_not_on_every_request(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        made = create_key(conn, "ci", {"read"})

    def use() -> tuple[object, object]:
        with transaction(engine) as conn:
            seen = authenticate(conn, made.secret).last_used
            version = conn.execute(sa.text("SELECT xmin::text, last_used_at FROM api_key")).one()
            assert seen == version.last_used_at
            return tuple(version)

    first = use()
    assert use() == first
    pass_time(engine, 61, made.key.id)
    assert use()[0] != first[0]


def test_a_key_of_a_suspended_tenant_opens_nothing(engine: sa.Engine) -> None:
    new_tenant(engine, "studio")
    with transaction(engine) as conn:
        made = create_key(conn, "ci", {"read"}, tenant="studio")
        suspend_tenant(conn, "studio")
        for check in (lambda: authenticate(conn, made.secret), lambda: check_key(conn, made.key.id)):
            with pytest.raises(Refused, match="suspended"):
                check()


@pytest.mark.parametrize("rates", [{"dance": "1/second"}, {"read": "0/second"}, {"read": "1/week"}, {"read": "fast"}])
def test_a_rate_that_cannot_be_is_refused(engine: sa.Engine, rates: dict[str, str]) -> None:
    with transaction(engine) as conn, pytest.raises(InvalidInput, match="rates"):
        create_key(conn, "ci", SCOPES, rates=rates)


def test_a_name_is_taken_by_keys_that_are_neither_revoked_nor_expired(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        unending, ending, revoked, expired = (
            create_key(conn, "ci", {"read"}, lifetime=lifetime).key.id for lifetime in (None, DAY, None, DAY)
        )
        create_key(conn, "other", {"read"})
        revoke_key(conn, "default", revoked)
    pass_time(engine, 2 * DAY, expired)
    with transaction(engine) as conn:
        assert {key.id for key in keys_named(conn, "default", "ci")} == {unending, ending}
        assert keys_named(conn, new_tenant(engine), "ci") == []
