"""Quotas of tenants, and claims that are fair between them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from uuid import UUID

import pytest
import sqlalchemy as sa
from sqlalchemy.exc import OperationalError

from marey.core.errors import Busy, Conflict, InvalidInput, NotFound, QuotaUsedUp
from marey.db import transaction
from marey.jobs import (
    Claim,
    NewItem,
    NewJob,
    Policy,
    begin_assets,
    cancel,
    claim,
    commit_motions,
    get_job,
    list_jobs,
    release,
    retry,
    submit,
    waiting_batches,
)
from marey.streams import NewStream, create_stream, end_stream, open_streams
from marey.takes import list_motions
from marey.tenants import (
    Quotas,
    check_quotas,
    create_key,
    create_tenant,
    get_tenant,
    list_tenants,
    reinstate_tenant,
    set_quotas,
    suspend_tenant,
    usage,
)
from marey.tenants.quotas import EXPECTED_BYTES, reserve_bytes, reserve_quotas
from tests.servers.audit import audit
from tests.servers.jobs import (
    claim_some,
    commit_all,
    motion_of,
    new_item,
    new_tenant,
    parse_texts,
    submit_items,
)


def all_at_once(count: int, act: Callable[[int], object]) -> list[BaseException]:
    """Do it in as many threads at one moment; what was raised."""
    gate, raised = threading.Barrier(count), list[BaseException]()

    def run(number: int) -> None:
        gate.wait()
        try:
            act(number)
        except BaseException as error:
            raised.append(error)

    threads = [threading.Thread(target=run, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return raised


def ready_items(count: int, **more: object) -> list[NewItem]:
    """Items that need no parsing."""
    return [new_item(n, text_key="", **more) for n in range(count)]


# --- tenants ---


def test_a_tenant_has_a_name_and_quotas_that_can_be_changed(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        made = create_tenant(conn, "studio-7", Quotas(queued=10, bytes=2**40))
        assert made.quotas == Quotas(queued=10, bytes=2**40)
        assert set_quotas(conn, "studio-7", {"running": 4, "queued": None}).quotas == Quotas(running=4, bytes=2**40)
        assert [row.id for row in list_tenants(conn)] == ["default", "studio-7"]
        with pytest.raises(Conflict, match="already"):
            create_tenant(conn, "studio-7")
        for act in (get_tenant, suspend_tenant, reinstate_tenant):
            with pytest.raises(NotFound, match="nobody"):
                act(conn, "nobody")
        with pytest.raises(InvalidInput, match="running"):
            set_quotas(conn, "studio-7", {"running": -1})
        largest = {"queued": 2**31 - 1, "running": 2**31 - 1, "bytes": 2**63 - 1, "streams": 2**31 - 1}
        assert set_quotas(conn, "studio-7", largest).quotas == Quotas(**largest)
        for name, value in largest.items():
            with pytest.raises(InvalidInput, match=f"not between 0 and {value}"):
                set_quotas(conn, "studio-7", {name: value + 1})


@pytest.mark.parametrize("name", ["", "Studio", "a/b", "../x", "-a", "a" * 64, "ä", "a b", "a\n"])
def test_a_name_that_cannot_stand_in_a_key_of_the_store_is_refused(engine: sa.Engine, name: str) -> None:
    with transaction(engine) as conn, pytest.raises(InvalidInput, match="tenant name"):
        create_tenant(conn, name)


# --- queued ---


def test_a_job_that_the_quota_has_no_room_for_is_refused_with_what_is_left(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=5)
    submit_items(engine, 3, tenant=tenant)
    with pytest.raises(QuotaUsedUp, match="3 of 5 are queued, 2 are left") as refused:
        submit_items(engine, 3, tenant=tenant)
    error = refused.value
    assert (error.quota, error.limit, error.used, error.asked, error.left) == ("queued", 5, 3, 3, 2)
    submit_items(engine, 2, tenant=tenant)
    submit_items(engine, 50)  # of another tenant
    with transaction(engine) as conn:
        assert len(list_jobs(conn, tenant).rows) == 2
        assert audit(conn) == []


def test_a_job_whose_count_is_known_is_refused_before_an_item_is_read(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=5)

    def items() -> object:
        raise AssertionError("read")
        yield

    with transaction(engine) as conn, pytest.raises(QuotaUsedUp):
        submit(conn, NewJob(items(), tenant=tenant, count=6))  # pyright: ignore[reportArgumentType]


def test_what_is_being_made_counts_as_queued_until_it_is_done(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=4)
    submit_items(engine, ready_items(4), tenant=tenant)
    found = claim_some(engine, limit=3)
    with pytest.raises(QuotaUsedUp):
        submit_items(engine, 1, tenant=tenant)
    commit_all(engine, found)
    submit_items(engine, 3, tenant=tenant)


def test_the_same_submit_again_is_answered_though_the_quota_is_full(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=2)
    job: dict[str, object] = {"tenant": tenant, "idempotency_key": "k", "body_sha256": "a"}
    assert submit_items(engine, 2, **job) == submit_items(engine, 2, **job)


def test_a_retry_needs_room_like_a_submit(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=3)
    job = submit_items(engine, 2, tenant=tenant)
    with transaction(engine) as conn:
        cancel(conn, tenant, job)
    other = submit_items(engine, 2, tenant=tenant)
    with transaction(engine) as conn, pytest.raises(QuotaUsedUp):
        retry(conn, tenant, job)
    with transaction(engine) as conn:
        assert get_job(conn, tenant, job).ready == 0
        cancel(conn, tenant, other)
        assert retry(conn, tenant, job).ready == 2


def test_eight_submits_at_once_never_exceed_the_quota(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=20)
    raised = all_at_once(8, lambda _: submit_items(engine, 5, tenant=tenant))
    assert [type(error) for error in raised] == [QuotaUsedUp] * 4
    with transaction(engine) as conn:
        assert usage(conn, tenant).queued == 20
        assert audit(conn) == []


def test_a_quota_of_nothing_lets_nothing_in(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=0)
    with pytest.raises(QuotaUsedUp):
        submit_items(engine, 1, tenant=tenant)


# --- running ---


def test_a_claim_takes_what_the_quota_of_running_items_leaves(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, running=5)
    submit_items(engine, ready_items(20), tenant=tenant)
    first = claim_some(engine, limit=3)
    second = claim_some(engine, limit=3)
    assert (len(first.items), len(second.items)) == (3, 2)
    with transaction(engine) as conn:
        assert claim(conn, "hgm3", "w", 3) is None
        assert waiting_batches(conn, {"hgm3": 4}) == {}
        assert usage(conn, tenant).running == 5
    commit_all(engine, first)
    assert len(claim_some(engine, limit=32).items) == 3


def test_a_tenant_at_its_quota_holds_up_nobody(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, running=0)
    submit_items(engine, ready_items(5), tenant=tenant, priority=1000)
    job = submit_items(engine, ready_items(1))
    assert claim_some(engine).job == job
    with transaction(engine) as conn:
        assert claim(conn, "hgm3", "w", 1, prefer_batch_key="batch of tiny@0") is None


def test_eight_claims_at_once_never_exceed_the_quota(engine: sa.Engine) -> None:
    """Of one tenant on as many jobs: their locks do not keep them apart."""
    tenant = new_tenant(engine, running=10)
    for _ in range(8):
        submit_items(engine, ready_items(4), tenant=tenant)
    found: list[Claim | None] = []

    def take(number: int) -> None:
        with transaction(engine) as conn:
            found.append(claim(conn, "hgm3", f"worker {number}", 4))

    assert all_at_once(8, take) == []
    assert sum(len(each.items) for each in found if each is not None) == 10
    with transaction(engine) as conn:
        assert usage(conn, tenant).running == 10
        assert audit(conn) == []


# --- bytes ---


def test_bytes_are_estimated_at_submit_and_settled_at_commit(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, bytes=3 * EXPECTED_BYTES)
    submit_items(engine, ready_items(3), tenant=tenant)
    with pytest.raises(QuotaUsedUp, match="0 of 1572864 are stored, 1572864 expected") as refused:
        submit_items(engine, 1, tenant=tenant)
    assert (refused.value.quota, refused.value.left) == ("bytes", 0)
    commit_all(engine, claim_some(engine))  # 36 bytes each
    with transaction(engine) as conn:
        assert (usage(conn, tenant).bytes, usage(conn, tenant).expected) == (3 * 36, 0)
    submit_items(engine, 1000, tenant=tenant)  # as those before: 36 bytes each


def test_a_look_at_the_room_tells_of_each_quota_and_refuses_as_a_submit_does(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=5, bytes=4 * EXPECTED_BYTES)
    submit_items(engine, 1, tenant=tenant)
    with transaction(engine) as conn:
        queued, size = check_quotas(conn, tenant, 3)
        assert (queued.quota, queued.limit, queued.used, queued.left, queued.asked) == ("queued", 5, 1, 4, 3)
        assert (size.quota, size.used, size.left) == ("bytes", EXPECTED_BYTES, 3 * EXPECTED_BYTES)
        for count, quota in ((4, "bytes"), (5, "queued")):
            with pytest.raises(QuotaUsedUp) as refused:
                check_quotas(conn, tenant, count)
            assert refused.value.quota == quota
        assert check_quotas(conn, "default", 10**6) == ()


def test_a_finished_item_is_kept_though_it_is_larger_than_what_is_left(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, bytes=EXPECTED_BYTES)
    job = submit_items(engine, ready_items(1), tenant=tenant)
    with transaction(engine) as conn:
        set_quotas(conn, tenant, {"bytes": 10})
    found = claim_some(engine)
    assert commit_all(engine, found) == [found.items[0].id]
    with transaction(engine) as conn:
        assert get_job(conn, tenant, job).succeeded == 1
        assert len(list_motions(conn, tenant).rows) == 1
    with pytest.raises(QuotaUsedUp, match="36 of 10 are stored"):
        submit_items(engine, 1, tenant=tenant)


def test_equal_content_of_one_tenant_is_stored_and_counted_once(engine: sa.Engine) -> None:
    tenant = new_tenant(engine)
    submit_items(engine, ready_items(2), tenant=tenant)
    found = claim_some(engine)
    motions = [motion_of(item.id, b"equal") for item in found.items]
    with transaction(engine) as conn:
        begin_assets(conn, found.lease_token, [file for motion in motions for file in motion.files.values()])
        commit_motions(conn, found.lease_token, motions)
        assert usage(conn, tenant).bytes == 5
        assert usage(conn, "default").bytes == 0


# --- live streams ---


def new_stream(conn: sa.Connection, tenant: str, key: UUID, limit: int = 4) -> UUID:
    return create_stream(conn, NewStream(tenant, key, "a person walks", "stroller", "stroller@0", 1, 100), limit=limit)


def test_a_tenants_own_quota_of_streams_goes_before_the_servers(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, streams=1)
    with transaction(engine) as conn:
        key = create_key(conn, "live", {"submit"}, tenant=tenant).key.id
        new_stream(conn, tenant, key)
        with pytest.raises(Busy, match="1 live streams"):
            new_stream(conn, tenant, key)
        assert usage(conn, tenant).streams == 1


def test_the_clip_of_a_stream_is_made_though_the_queue_is_full(engine: sa.Engine) -> None:
    tenant = new_tenant(engine, queued=0)
    with transaction(engine) as conn:
        stream = new_stream(conn, tenant, create_key(conn, "live", {"submit"}, tenant=tenant).key.id)
        assert end_stream(conn, stream, None, "stopped", clip=(new_item(0), b"recording"))
        assert len(list_jobs(conn, tenant).rows) == 1


# --- suspended ---


def test_of_a_suspended_tenant_nothing_is_begun_and_what_runs_is_finished(engine: sa.Engine) -> None:
    tenant = new_tenant(engine)
    job = submit_items(engine, ready_items(4), tenant=tenant)
    found = claim_some(engine, limit=1)
    with transaction(engine) as conn:
        stream = new_stream(conn, tenant, create_key(conn, "live", {"submit"}, tenant=tenant).key.id)
        assert suspend_tenant(conn, tenant).suspended is not None
        assert claim(conn, "hgm3", "w", 1) is None
        assert waiting_batches(conn, {"hgm3": 1}) == {}
        assert open_streams(conn, "stroller@0") == []
    assert len(commit_all(engine, found)) == 1
    with transaction(engine) as conn:
        assert reinstate_tenant(conn, tenant).suspended is None
        assert [row.id for row in open_streams(conn, "stroller@0")] == [stream]
    assert claim_some(engine).job == job


# --- fair claims ---


def test_thousands_of_items_do_not_delay_five(engine: sa.Engine) -> None:
    """With one worker, that has its hands full: the next batch is the other tenant's, whatever the priority."""
    large = submit_items(engine, ready_items(3000), priority=1000)
    assert claim_some(engine).job == large
    small = submit_items(engine, ready_items(5), tenant=new_tenant(engine), priority=-1000)
    found = claim_some(engine)
    assert (found.job, len(found.items)) == (small, 5)


def test_a_tenant_that_runs_less_waits_five_seconds_for_a_loaded_bundle_and_no_longer(engine: sa.Engine) -> None:
    large = submit_items(engine, ready_items(50, bundle="a@1"))
    small = submit_items(engine, ready_items(5, bundle="b@1"), tenant=new_tenant(engine))
    loaded = claim_some(engine, limit=4)
    assert loaded.job == large
    assert claim_some(engine, limit=4, prefer_batch_key=loaded.batch_key).job == large

    def wait(seconds: float) -> None:
        with transaction(engine) as conn:
            query = "UPDATE lane SET waiting_since = now() - make_interval(secs => :seconds) WHERE job_id = :job"
            conn.execute(sa.text(query), {"job": small, "seconds": seconds})

    wait(Policy().tenant_patience + 1)
    other = claim_some(engine, limit=4, prefer_batch_key=loaded.batch_key)
    assert other.job == small
    with transaction(engine) as conn:
        release(conn, other.lease_token, "tried")
        release(conn, loaded.lease_token, "tried")  # 4 of the large one still run
    wait(Policy().tenant_patience - 3)
    assert claim_some(engine, limit=4, prefer_batch_key=loaded.batch_key).job == large


def test_a_tenant_of_many_jobs_has_no_more_than_one_of_a_single_job(engine: sa.Engine) -> None:
    tenant = new_tenant(engine)
    for _ in range(10):
        submit_items(engine, ready_items(3))
    submit_items(engine, ready_items(30), tenant=tenant)
    parse_texts(engine)
    taken = [claim_some(engine, limit=1).tenant for _ in range(10)]
    assert taken.count(tenant) == 5


@pytest.mark.parametrize("reserve", [reserve_quotas, reserve_bytes])
def test_nothing_waits_for_a_tenant_without_quotas(
    engine: sa.Engine, reserve: Callable[[sa.Connection, str, int], None]
) -> None:
    free, bound = new_tenant(engine), new_tenant(engine, "bound", queued=10, bytes=10 * EXPECTED_BYTES)
    with transaction(engine) as first, transaction(engine) as second:
        second.execute(sa.text("SET LOCAL lock_timeout = 50"))
        for tenant in (free, bound):
            reserve(first, tenant, 1)
        reserve(second, free, 1)
        with pytest.raises(OperationalError, match="lock timeout"):
            reserve(second, bound, 1)
