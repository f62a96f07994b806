"""Files made on request: by the API, once each, and gone with the motion, its prompt, or the quota."""

from __future__ import annotations

import hashlib
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any
from uuid import UUID

import httpx2
import pytest
import sqlalchemy as sa

from marey.api.making import maker
from marey.api.making.processes import MakingProcess, MakingProcesses
from marey.db import transaction
from marey.exporters.making import FileRecipe
from marey.jobs import FailureReason, asset_key, tables
from marey.motion.export_options import ExportOptions
from marey.storage import FolderStore
from marey.takes import (
    MakingClaim,
    NewRig,
    RigRow,
    add_rig,
    claim_making,
    collect_garbage,
    delete,
    erase,
    fail_making,
    find_made,
    keep_made,
    remove_expired_makings,
    remove_rig,
    renew_makings,
    rewrite_files,
)
from marey.tenants import Actor, usage
from tests.integration.takes.test_retention import SECRET, digest, dump, made, objects
from tests.servers.audit import audit
from tests.servers.ports import free_ports
from tests.support.live_api import ApiThread, LiveApi, settings_of, wait_until
from tests.support.walker import walker

PROMPT = f"a person walks to {SECRET}"
CLIP = walker(seconds=0.5, prompt=PROMPT)
NPZ = CLIP.to_npz()
QUOTA = 10**9


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Requests wait for files on a busy machine too."""
    monkeypatch.setattr(maker, "WAIT_SECONDS", 60.0)


@pytest.fixture(scope="module")
def motion(api: LiveApi) -> dict[str, str]:
    """A motion with a real npz: its id, and that of its job."""
    with api.client() as client:
        job = client.submit([{"prompt": PROMPT}])
        api.work(NPZ)
        (found,) = client.pages(f"/v1/jobs/{job['id']}/motions")
    return {"id": found["id"], "job": job["id"]}


def rows(engine: sa.Engine) -> list[sa.Row[tuple[object, ...]]]:
    with transaction(engine) as conn:
        return list(conn.execute(sa.select(tables.made_file).order_by(tables.made_file.c.made_at)))


def path_of(motion: dict[str, str], format: str) -> str:
    return f"/v1/motions/{motion['id']}/files/{format}"


def test_a_file_is_made_on_request_and_again_byte_for_byte(
    api: LiveApi, http: httpx2.Client, motion: dict[str, str]
) -> None:
    path = path_of(motion, "glb")
    asked = {"fps": "30", "mesh": "true", "in_place": "heading"}
    first = http.get(path, params=asked)
    assert first.status_code == 200, first.text
    wanted = FileRecipe("glb", ExportOptions(mesh=True, in_place="heading"), 30.0).make(NPZ, "motion")
    assert first.content == wanted
    assert first.headers["etag"] == f'"{hashlib.sha256(wanted).hexdigest()}"'
    assert first.headers["content-type"] == "model/gltf-binary"
    assert first.headers["content-disposition"].endswith('.glb"')
    assert first.headers["cache-control"] == "private, no-cache"
    same = http.get(path, params=[*reversed(asked.items())], headers={"If-None-Match": first.headers["etag"]})
    assert same.status_code == 304
    head = http.head(path, params=asked)
    assert (head.status_code, head.headers["content-length"], head.content) == (200, str(len(wanted)), b"")
    assert http.get(path, params=asked, headers={"Range": "bytes=4-7"}).content == wanted[4:8]
    assert len(rows(api.engine)) == 1
    with transaction(api.engine) as conn:
        conn.execute(sa.delete(tables.made_file))
    collect_garbage(api.engine, api.store)
    again = http.get(path, params=asked)
    assert (again.content, again.headers["etag"]) == (wanted, first.headers["etag"])
    shown = http.get(f"/v1/motions/{motion['id']}").json()
    assert [file["format"] for file in shown["files"]] == ["bvh", "npz"]


def test_a_stored_file_is_sent_as_it_is(api: LiveApi, http: httpx2.Client, motion: dict[str, str]) -> None:
    before = len(rows(api.engine))
    for asked in ({}, {"fps": "20"}, {"root_bone": "false", "bvh_root": "zero"}):
        assert http.get(path_of(motion, "bvh"), params=asked).content == NPZ  # `work` stores it as every format
    assert len(rows(api.engine)) == before
    made_here = http.get(path_of(motion, "bvh"), params={"root_bone": "true"})
    assert made_here.text.startswith("HIERARCHY\nROOT root")


@pytest.mark.parametrize(
    ("format", "asked", "where"),
    [
        ("glb", "mehs=true", "mehs"),
        ("glb", "mesh=perhaps", "mesh"),
        ("glb", "rest_pose=a", "rest_pose"),
        ("glb", "in_place=true", "in_place"),
        ("bvh", "mesh=true", "mesh"),
        ("gif", "root_bone=true", "root_bone"),
        ("npz", "placement=keep", "placement"),
        ("bvh", "root_bone=true&bvh_root=offset", "bvh_root"),
        ("glb", "in_place=travel&placement=keep", "placement"),
        ("glb", "fps=0", "fps"),
        ("glb", "fps=241", "fps"),
        ("glb", "fps=nan", "fps"),
        ("bvh", "rest_pose=a", "format"),
    ],
)
def test_unknown_and_senseless_options_are_refused(
    http: httpx2.Client, motion: dict[str, str], format: str, asked: str, where: str
) -> None:
    for _ in range(2):  # the second answer comes from the row
        answer = http.get(f"{path_of(motion, format)}?{asked}")
        assert answer.status_code == 422, answer.text
        assert answer.json()["where"] == where
        assert answer.json()["detail"]


def test_formats_that_no_exporter_makes_and_motions_of_others_are_not_found(
    api: LiveApi, http: httpx2.Client, motion: dict[str, str]
) -> None:
    answer = http.get(path_of(motion, "xyz"))
    assert answer.status_code == 404
    assert "glb" in answer.json()["hint"]
    with api.http("submit") as lesser:
        assert lesser.get(path_of(motion, "glb"), params={"mehs": "1"}).status_code == 403
    assert httpx2.get(f"{api.url}{path_of(motion, 'glb')}", params={"mehs": "1"}).status_code == 401


def test_what_takes_long_is_answered_with_202_and_goes_on(
    api: LiveApi, http: httpx2.Client, motion: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {"fps": "10"}
    with monkeypatch.context() as patched:
        patched.setattr(maker, "WAIT_SECONDS", 0.01)
        answer = http.get(path_of(motion, "gif"), params=asked)
    assert answer.status_code == 202
    assert answer.json() == {"format": "gif", "retry_after": 2}
    assert answer.headers["retry-after"] == "2"
    wait_until(lambda: rows(api.engine)[-1].asset_id is not None, 60)  # without another request
    assert http.get(path_of(motion, "gif"), params=asked).content.startswith(b"GIF89a")


def test_two_processes_make_a_file_once(
    api: LiveApi, motion: dict[str, str], module_database_url: str, queue_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    times: list[str] = []
    make = MakingProcesses.make

    async def counted(self: MakingProcesses, recipe: FileRecipe, *sources: Any) -> bytes | FailureReason:
        times.append(recipe.format)
        return await make(self, recipe, *sources)

    monkeypatch.setattr(MakingProcesses, "make", counted)
    assert isinstance(api.store, FolderStore)
    config = settings_of(api.store.root.parent, module_database_url, queue_url)
    path = f"{path_of(motion, 'glb')}?tpose_frame=true"
    headers = {"Authorization": f"Bearer {api.key}"}
    with ApiThread(config.model_copy(update={"port": free_ports(1)[0]})) as other, ThreadPoolExecutor(6) as pool:
        urls = [f"{url}{path}" for url in (api.url, other) * 3]
        answers = list(pool.map(lambda url: httpx2.get(url, headers=headers, timeout=20), urls))
    assert {answer.status_code for answer in answers} == {200}
    assert len({answer.content for answer in answers}) == 1
    assert times == ["glb"]


def test_a_motion_whose_npz_is_broken_is_a_conflict(api: LiveApi, http: httpx2.Client) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": "a person bows"}])
        api.work(b"no npz")
        (found,) = client.pages(f"/v1/jobs/{job['id']}/motions")
    answer = http.get(f"/v1/motions/{found['id']}/files/glb")
    assert answer.status_code == 409
    assert answer.json()["where"] == f"motion {found['id']}"


def test_a_process_that_takes_too_long_or_dies_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    short = MakingProcess(seconds=1)
    late = short.make(FileRecipe("gif"), walker(seconds=9.0).to_npz(), "motion")
    assert isinstance(late, FailureReason)
    assert late.message == "the file takes longer than 1 s to make"
    assert not short.alive
    short.close()
    small = MakingProcess(memory=2**24)
    assert isinstance(small.make(FileRecipe("glb"), NPZ, "motion"), FailureReason)
    small.close()


# --- rows, without an API ---


@pytest.fixture
def job(engine: sa.Engine, folder_store: FolderStore) -> UUID:
    return made(engine, folder_store, PROMPT)


def claim(
    engine: sa.Engine, job: UUID, key: str = "k", seconds: float | None = None, rig: RigRow | None = None
) -> MakingClaim | None:
    with transaction(engine) as conn:
        motion = conn.execute(sa.select(tables.motion.c.id).where(tables.motion.c.job_id == job)).scalar_one()
        source = conn.execute(
            sa.select(tables.asset.c.sha256)
            .join(tables.motion_file, tables.motion_file.c.asset_id == tables.asset.c.id)
            .where(tables.motion_file.c.motion_id == motion, tables.motion_file.c.format == "npz")
        ).scalar_one()
        found = claim_making(conn, "default", motion, source=source, key=key, format="glb", rig=rig)
        if seconds is not None:
            clock = sa.func.clock_timestamp() + sa.func.make_interval(0, 0, 0, 0, 0, 0, seconds)
            conn.execute(sa.update(tables.made_file).where(tables.made_file.c.key == key).values(expires_at=clock))
    return found


def keep(engine: sa.Engine, store: FolderStore, job: UUID, key: str, content: bytes, quota: int = QUOTA) -> MakingClaim:
    found = claim(engine, job, key)
    assert found is not None
    assert keep_made(engine, store, found, content, "x/y", quota=quota)
    return found


def there(store: FolderStore, content: bytes, tenant: str = "default") -> bool:
    return store.exists(asset_key(tenant, digest(content).sha256))


def test_a_claim_is_taken_over_when_its_process_is_silent(
    engine: sa.Engine, folder_store: FolderStore, job: UUID
) -> None:
    first = claim(engine, job)
    assert first is not None
    assert claim(engine, job) is None
    renew_makings(engine, [first.token])
    second = claim(engine, job, seconds=-1)
    assert second is None  # it had been renewed
    second = claim(engine, job)
    assert second is not None
    assert not keep_made(engine, folder_store, first, b"late", "x/y", quota=QUOTA)
    assert not there(folder_store, b"late")
    assert keep_made(engine, folder_store, second, b"in time", "x/y", quota=QUOTA)
    assert claim(engine, job) is None
    with transaction(engine) as conn:
        assert not audit(conn)


def test_a_failure_is_kept_for_a_while(engine: sa.Engine, job: UUID) -> None:
    found = claim(engine, job)
    assert found is not None
    fail_making(engine, found, FailureReason("invalid-input", "it cannot be danced"))
    with transaction(engine) as conn:
        kept = find_made(conn, found.motion, "k")
        assert kept is not None
        assert kept.problem == FailureReason("invalid-input", "it cannot be danced")
    assert claim(engine, job, seconds=-1) is None
    with transaction(engine) as conn:
        assert find_made(conn, found.motion, "k") is None
    assert claim(engine, job, seconds=-7200) is not None
    assert remove_expired_makings(engine) == 1
    assert rows(engine) == []


def test_the_oldest_files_of_a_tenant_are_removed_beyond_the_quota(
    engine: sa.Engine, folder_store: FolderStore, job: UUID
) -> None:
    contents = [bytes([number]) * 100 for number in range(4)]
    for number, content in enumerate(contents[:3]):
        keep(engine, folder_store, job, f"k{number}", content, quota=300)
    assert all(there(folder_store, content) for content in contents[:3])
    keep(engine, folder_store, job, "k3", contents[3], quota=250)
    assert [there(folder_store, content) for content in contents] == [False, False, True, True]
    assert [row.key for row in rows(engine)] == ["k2", "k3"]
    keep(engine, folder_store, job, "large", b"l" * 1000, quota=250)  # the newest stays
    assert [row.key for row in rows(engine)] == ["large"]
    with transaction(engine) as conn:
        assert not audit(conn)


def test_evicted_content_that_is_a_file_of_the_motion_stays(
    engine: sa.Engine, folder_store: FolderStore, job: UUID
) -> None:
    keep(engine, folder_store, job, "same", b"HIERARCHY")  # as the motion's BVH
    keep(engine, folder_store, job, "new", b"new", quota=0)
    assert [row.key for row in rows(engine)] == ["new"]
    assert there(folder_store, b"HIERARCHY")


def test_made_files_do_not_count_as_bytes_of_the_tenant(
    engine: sa.Engine, folder_store: FolderStore, job: UUID
) -> None:
    def stored() -> int:
        with transaction(engine) as conn:
            return usage(conn, "default").bytes

    before = stored()
    keep(engine, folder_store, job, "k", b"made" * 1000)
    keep(engine, folder_store, job, "same", b"HIERARCHY")
    assert stored() == before


def test_made_files_go_with_their_job(engine: sa.Engine, folder_store: FolderStore, job: UUID) -> None:
    keep(engine, folder_store, job, "k", b"made")
    unfinished = claim(engine, job, "unfinished")
    assert unfinished is not None
    with transaction(engine) as conn:
        delete(conn, "default", job)
    assert rows(engine) == []
    assert not keep_made(engine, folder_store, unfinished, b"too late", "x/y", quota=QUOTA)
    collect_garbage(engine, folder_store)
    assert objects(folder_store) == []


def test_made_files_go_with_their_rig_and_are_claimed_for_its_version_alone(
    engine: sa.Engine, folder_store: FolderStore, job: UUID
) -> None:
    hero, ann = NewRig("default", "hero", "glb", b"file", None, {}), Actor("ann", None)
    first = add_rig(engine, folder_store, hero, ann, limit=9).rig
    late = claim(engine, job, "first", rig=first)
    assert late is not None
    second = add_rig(engine, folder_store, replace(hero, map={"left_toes": None}), ann, limit=9).rig
    assert rows(engine) == []
    assert not keep_made(engine, folder_store, late, b"too late", "x/y", quota=QUOTA)
    assert claim(engine, job, "first", rig=first) is None
    assert claim(engine, job, "second", rig=second) is not None
    with transaction(engine) as conn:
        remove_rig(conn, "default", "hero")
    assert rows(engine) == []
    assert claim(engine, job, "second", rig=second) is None


def test_made_files_go_with_the_prompt(engine: sa.Engine, folder_store: FolderStore, job: UUID) -> None:
    glb = FileRecipe("glb").make(NPZ, "motion")
    assert SECRET.encode() in glb
    keep(engine, folder_store, job, "k", glb)
    unfinished = claim(engine, job, "unfinished")
    assert unfinished is not None
    with transaction(engine) as conn:
        erase(conn, "default", job, by="ann")
    assert rows(engine) == []
    with transaction(engine) as conn:  # while the npz waits to be rewritten
        again = replace(unfinished, key="other")
        assert claim_making(conn, "default", again.motion, source=again.source, key="other", format="glb") is None
    assert not keep_made(engine, folder_store, unfinished, glb + b"late", "x/y", quota=QUOTA)
    rewrite_files(engine, folder_store)
    assert not any(SECRET.encode(coding) in data for data in objects(folder_store) for coding in ("utf-8", "utf-32-le"))
    assert SECRET not in dump(engine)


def test_an_erasure_waits_for_a_file_that_is_being_kept_and_removes_it(
    engine: sa.Engine, folder_store: FolderStore, job: UUID, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The erasure begins after the npz was found to be the source, and before the file is in the table."""
    from marey.takes import made as made_files

    record, erasing, threads = made_files._record, threading.Event(), []

    def erase_job() -> None:
        with transaction(engine) as conn:
            erasing.set()
            erase(conn, "default", job, by="ann")

    def slowly(conn: sa.Connection, claim: MakingClaim, asset: UUID, size: int) -> None:
        threads.append(threading.Thread(target=erase_job))
        threads[0].start()
        assert erasing.wait(10)
        threads[0].join(0.3)
        assert threads[0].is_alive()  # it waits for the npz
        record(conn, claim, asset, size)

    monkeypatch.setattr(made_files, "_record", slowly)
    keep(engine, folder_store, job, "k", b"made with " + SECRET.encode())
    threads[0].join(10)
    assert rows(engine) == []
    rewrite_files(engine, folder_store)
    assert not there(folder_store, b"made with " + SECRET.encode())
