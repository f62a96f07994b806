"""Garbage collection: after it every object has a row and every row its object; nothing in use is touched."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Sequence

import pytest
import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.db import transaction
from marey.jobs import Policy, asset_key, begin_assets, cancel, commit_motions, get_motion, sweep
from marey.jobs.lease_types import Claim, NewMotion
from marey.storage import AssetStore, FolderStore
from marey.takes import GarbageReport, collect_garbage, delete, gc, list_motions, remove_stale_assets
from tests.servers.jobs import claim_some, let_expire, motion_of, parse_texts, submit_items

HOUR_AGO = sa.text("UPDATE asset SET announced_at = now() - interval '61 minutes'")


@pytest.fixture(params=["folder", "s3"])
def store(request: pytest.FixtureRequest) -> AssetStore:
    return request.getfixturevalue(f"{request.param}_store")


def key_of(motion: NewMotion) -> str:
    return asset_key("default", motion.files["npz"].sha256)


def work(engine: sa.Engine, store: AssetStore, claimed: Claim, *, commit: bool = True) -> list[NewMotion]:
    """Announce, put and commit, as a worker does; or die before the commit."""
    motions = [motion_of(item.id) for item in claimed.items]
    with transaction(engine) as conn:
        assert begin_assets(conn, claimed.lease_token, [motion.files["npz"] for motion in motions])
    for motion in motions:
        store.put(key_of(motion), str(motion.item).encode())
    if commit:
        with transaction(engine) as conn:
            commit_motions(conn, claimed.lease_token, motions)
    return motions


def rows(engine: sa.Engine) -> set[str]:
    """Keys of the asset rows."""
    with transaction(engine) as conn:
        return {asset_key(*row) for row in conn.execute(sa.text("SELECT tenant_id, sha256 FROM asset"))}


def test_what_a_lost_worker_left_goes_and_what_is_used_stays(engine: sa.Engine, store: AssetStore) -> None:
    job = submit_items(engine, 4)
    parse_texts(engine)
    kept = work(engine, store, claim_some(engine, limit=2))
    died = claim_some(engine, limit=2)
    work(engine, store, died, commit=False)
    orphan = asset_key("default", hashlib.sha256(b"orphan").hexdigest())
    store.put(orphan, b"orphan")
    assert collect_garbage(engine, store) == GarbageReport(rows=0, orphans=1, missing=())
    let_expire(engine, died.lease_token)
    sweep(engine)
    assert collect_garbage(engine, store) == GarbageReport(rows=2, orphans=0, missing=())
    assert set(store.keys()) == rows(engine) == {key_of(motion) for motion in kept}
    with transaction(engine) as conn:
        cancel(conn, "default", job)
        delete(conn, "default", job)
    assert collect_garbage(engine, store).rows == 2
    assert list(store.keys()) == []


def test_content_that_two_jobs_share_stays_while_one_uses_it(engine: sa.Engine, folder_store: FolderStore) -> None:
    jobs = [submit_items(engine, 1) for _ in range(2)]
    parse_texts(engine)
    for _ in jobs:
        claimed = claim_some(engine)
        motion = motion_of(claimed.items[0].id, b"the same")
        with transaction(engine) as conn:
            begin_assets(conn, claimed.lease_token, [motion.files["npz"]])
            folder_store.put(key_of(motion), b"the same")
            commit_motions(conn, claimed.lease_token, [motion])
    with transaction(engine) as conn:
        delete(conn, "default", jobs[0])
    assert collect_garbage(engine, folder_store) == GarbageReport(0, 0, ())
    with transaction(engine) as conn:
        delete(conn, "default", jobs[1])
    assert collect_garbage(engine, folder_store).rows == 1


def test_a_lost_object_is_told(engine: sa.Engine, folder_store: FolderStore) -> None:
    submit_items(engine, 2)
    parse_texts(engine)
    motions = work(engine, folder_store, claim_some(engine))
    folder_store.delete(key_of(motions[0]))
    assert collect_garbage(engine, folder_store).missing == (key_of(motions[0]),)


def test_what_is_not_an_asset_stays_in_the_store(engine: sa.Engine, folder_store: FolderStore) -> None:
    for key in ("readme.txt", "t/default/notes"):
        folder_store.put(key, b"mine")
    collect_garbage(engine, folder_store)
    assert list(folder_store.keys()) == ["readme.txt", "t/default/notes"]


def test_content_of_a_tenant_that_is_gone_is_an_orphan(engine: sa.Engine, folder_store: FolderStore) -> None:
    folder_store.put(asset_key("gone", hashlib.sha256(b"x").hexdigest()), b"x")
    assert collect_garbage(engine, folder_store).orphans == 1


def test_the_sweeper_waits_an_hour_with_what_is_being_written(engine: sa.Engine, folder_store: FolderStore) -> None:
    submit_items(engine, 2)
    parse_texts(engine)
    died = claim_some(engine)
    work(engine, folder_store, died, commit=False)
    with transaction(engine) as conn:
        conn.execute(HOUR_AGO)
    assert remove_stale_assets(engine, folder_store) == 0  # its lease lives
    let_expire(engine, died.lease_token)
    assert sweep(engine, rules=Policy(asset_grace=4000)).stale_assets == 0
    assert remove_stale_assets(engine, folder_store, rules=Policy(asset_grace=4000)) == 0
    assert sweep(engine).stale_assets == 2
    assert remove_stale_assets(engine, folder_store) == 2
    assert list(folder_store.keys()) == []


def test_content_that_is_announced_after_the_listing_stays(engine: sa.Engine, folder_store: FolderStore) -> None:
    submit_items(engine, 1)
    parse_texts(engine)
    claimed = claim_some(engine)
    motion = motion_of(claimed.items[0].id)
    folder_store.put(key_of(motion), str(motion.item).encode())

    known = gc._known

    def known_then_announced(engine: sa.Engine, keys: Sequence[str]) -> set[str]:
        found = known(engine, keys)
        with transaction(engine) as conn:  # a worker, while the collector looks at the list
            begin_assets(conn, claimed.lease_token, [motion.files["npz"]])
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "_known", known_then_announced)
        assert collect_garbage(engine, folder_store).orphans == 0
    assert folder_store.get(key_of(motion)) == str(motion.item).encode()


def test_a_store_outage_stops_the_collection_and_loses_nothing(engine: sa.Engine, folder_store: FolderStore) -> None:
    submit_items(engine, 1)
    parse_texts(engine)
    died = claim_some(engine)
    work(engine, folder_store, died, commit=False)
    let_expire(engine, died.lease_token)
    sweep(engine)

    class Away(FolderStore):
        def delete(self, key: str) -> None:
            raise Unreachable("gone")

    with pytest.raises(Unreachable):
        collect_garbage(engine, Away(folder_store.root))
    assert len(rows(engine)) == 1
    assert collect_garbage(engine, folder_store).rows == 1


def test_a_worker_that_writes_the_same_content_waits_for_the_collector(
    engine: sa.Engine, folder_store: FolderStore
) -> None:
    """The race that loses data without locks: the collector deletes what a worker has just put again."""
    submit_items(engine, 2)
    parse_texts(engine)
    died = claim_some(engine, limit=1)
    content = b"the same"
    motion = motion_of(died.items[0].id, content)
    with transaction(engine) as conn:
        begin_assets(conn, died.lease_token, [motion.files["npz"]])
    folder_store.put(key_of(motion), content)
    let_expire(engine, died.lease_token)
    sweep(engine)

    deleting, go_on = threading.Event(), threading.Event()

    class Slow(FolderStore):
        def delete(self, key: str) -> None:
            deleting.set()
            assert go_on.wait(10)
            super().delete(key)

    collector = threading.Thread(target=collect_garbage, args=(engine, Slow(folder_store.root)))
    collector.start()
    assert deleting.wait(10)
    claimed = claim_some(engine, limit=1)
    again = motion_of(claimed.items[0].id, content)

    def write() -> None:
        with transaction(engine) as conn:
            assert begin_assets(conn, claimed.lease_token, [again.files["npz"]])
        folder_store.put(key_of(again), content)
        with transaction(engine) as conn:
            commit_motions(conn, claimed.lease_token, [again])

    worker = threading.Thread(target=write)
    worker.start()
    worker.join(0.2)
    assert worker.is_alive()
    go_on.set()
    collector.join()
    worker.join()
    with transaction(engine) as conn:
        made = list_motions(conn, "default").rows
        assert [file.sha256 for file in get_motion(conn, "default", made[0].id).files] == [motion.files["npz"].sha256]
    assert folder_store.get(key_of(again)) == content
    assert collect_garbage(engine, folder_store) == GarbageReport(0, 0, ())
