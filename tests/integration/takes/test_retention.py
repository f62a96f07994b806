"""Jobs that go after their days, and prompts that are gone wherever they stood."""

from __future__ import annotations

import hashlib
import threading
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx2
import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, NotFound, PluginError
from marey.db import transaction
from marey.db.deadlines import BULK, MAINTENANCE, Deadline
from marey.jobs import (
    AssetDigest,
    FailureReason,
    ItemFailure,
    JobState,
    NewMotion,
    asset_key,
    begin_assets,
    cancel,
    commit_motions,
    fail_items,
    get_job,
    list_items,
    retry,
    submit,
)
from marey.jobs.types import NewJob
from marey.motion.clip import parse_npz
from marey.storage import FolderStore
from marey.streams import (
    NewStream,
    StreamChunk,
    add_chunk,
    create_stream,
    end_stream,
    get_stream,
    prompts_with_rewrites,
    take_stream,
)
from marey.streams.rewrites import PromptRewrite
from marey.takes import GarbageReport, collect_garbage, delete_expired, erase, gc, retention, rewrite_files
from marey.tenants import DEFAULT_TENANT, create_key
from tests.servers.audit import audit
from tests.servers.jobs import claim_some, new_item, parse_texts, submit_items
from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.plugins import installed, write_distribution
from tests.support.walker import walker

SECRET = "zanzibar"
PROMPT = f"a person walks to {SECRET}"


def made(
    engine: sa.Engine, store: FolderStore, *prompts: str, fail: int = 0, npz: bytes | None = None, **job: object
) -> UUID:
    """A job whose files hold their prompts, the last `fail` of them failed with a message that quotes it."""
    identifier = submit_items(engine, [new_item(k, prompt) for k, prompt in enumerate(prompts)], **job)
    parse_texts(engine)
    claimed = claim_some(engine)
    good, bad = claimed.items[: len(prompts) - fail], claimed.items[len(prompts) - fail :]
    motions: list[NewMotion] = []
    for item in good:
        own = npz or walker(seconds=0.2, prompt=item.prompt).to_npz()
        bvh = b"HIERARCHY"
        files = {"npz": digest(own), "bvh": digest(bvh)}
        for data in (own, bvh):
            store.put(asset_key("default", digest(data).sha256), data)
        metadata = {"prompt": item.prompt, "rewritten": item.prompt, "graph": {"text": item.prompt}, "seed": 7}
        motions.append(NewMotion(item.id, files, 40, 20.0, "MIT", 0.5, metadata))
    with transaction(engine) as conn:
        begin_assets(conn, claimed.lease_token, [file for motion in motions for file in motion.files.values()])
        problem = FailureReason("invalid-input", f"{PROMPT!r} cannot be danced")
        fail_items(conn, claimed.lease_token, [ItemFailure(item.id, problem, False) for item in bad])
        commit_motions(conn, claimed.lease_token, motions)
    return identifier


def digest(data: bytes) -> AssetDigest:
    return AssetDigest(hashlib.sha256(data).hexdigest(), len(data))


def dump(engine: sa.Engine) -> str:
    """Every row of every table as text; bytes too."""
    with transaction(engine) as conn:
        tables = sa.inspect(conn).get_table_names()
        rows = [conn.exec_driver_sql(f'SELECT * FROM "{table}"').mappings().all() for table in tables]
    return "\n".join(
        repr({name: bytes(v) if isinstance(v, memoryview) else v for name, v in row.items()})
        for each in rows
        for row in each
    )


def objects(store: FolderStore) -> list[bytes]:
    return [store.get(key) for key in list(store.keys())]


def test_an_erased_timeline_is_in_no_table(engine: sa.Engine) -> None:
    rows = [{"start": 0.0, "end": 3.0, "prompt": PROMPT}]
    job = submit_items(engine, [new_item(0, f"0-3 {PROMPT}", timeline=rows)])
    with transaction(engine) as conn:
        cancel(conn, "default", job)
        assert SECRET in str(list_items(conn, "default", job).rows[0].timeline)
        erase(conn, "default", job, by="ann")
    assert SECRET not in dump(engine)


def test_an_erased_prompt_is_in_no_table_and_no_file(engine: sa.Engine, folder_store: FolderStore) -> None:
    key = {"idempotency_key": "k", "body_sha256": "b"}
    job = made(engine, folder_store, PROMPT, f"{PROMPT} twice", PROMPT + " thrice", fail=1, **key)
    other = made(engine, folder_store, "a person bows")
    assert SECRET in dump(engine)
    assert any(SECRET.encode("utf-32-le") in data for data in objects(folder_store))  # as numpy writes a text
    with transaction(engine) as conn:
        left = erase(conn, "default", job, by="ann")
        files = [
            file.format for item in list_items(conn, "default", job).rows if item.motion for file in item.motion.files
        ]
    assert left.files_left == 2
    assert files == ["bvh", "bvh"]  # the others cannot be fetched meanwhile
    assert SECRET not in dump(engine)
    assert rewrite_files(engine, folder_store) == 2
    assert not any(SECRET.encode(coding) in data for data in objects(folder_store) for coding in ("utf-8", "utf-32-le"))
    with transaction(engine) as conn:
        assert erase(conn, "default", job, by="bob") == type(left)(job, left.erased, 0)
        items = list_items(conn, "default", job).rows
        motion = items[0].motion
        assert motion is not None
        assert (motion.metadata, motion.seed) == ({"seed": 7}, 0)
        assert items[2].problem == FailureReason("invalid-input", "erased with the prompt")
        npz = next(file for file in motion.files if file.format == "npz")
        assert list_items(conn, "default", other).rows[0].prompt == "a person bows"
        assert audit(conn) == []
    clip = parse_npz(folder_store.get(asset_key("default", npz.sha256)))
    assert clip.manifest == {"seed": 7, "erased": True}
    assert (clip.joints == walker(seconds=0.2).joints).all()
    assert collect_garbage(engine, folder_store) == GarbageReport(0, 0, ())
    with pytest.raises(Conflict, match="prompts were erased"), transaction(engine) as conn:
        retry(conn, "default", job)


def test_what_was_said_to_a_stream_is_erased_with_its_clip(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        key = create_key(conn, "live", ["submit"]).key.id
        stream = create_stream(conn, NewStream(DEFAULT_TENANT, key, PROMPT, "stroller", "m@0", 1, 9), limit=1)
        take_stream(conn, stream, 1, "worker")
        read = PromptRewrite(f"{PROMPT} now", f"it leaves out {SECRET}")
        add_chunk(conn, stream, 1, StreamChunk(0, 2, b"0" * 8, [(0, PROMPT)], "1-0", reads=[read]))
        clip = new_item(0, PROMPT, model="stroller", text_key="stream-1")
        end_stream(conn, stream, 1, "stopped", clip=(clip, PROMPT.encode()))
        job = get_stream(conn, DEFAULT_TENANT, stream).job
        assert job is not None
        cancel(conn, DEFAULT_TENANT, job)
    with transaction(engine) as conn:
        assert prompts_with_rewrites(conn, stream)[0].read == read
        erase(conn, DEFAULT_TENANT, job, by="ann")
    assert SECRET not in dump(engine)


def test_features_that_another_job_counts_on_stay_and_a_submit_under_way_is_waited_for(
    engine: sa.Engine, folder_store: FolderStore
) -> None:
    job = made(engine, folder_store, PROMPT)
    erasing, committed = threading.Event(), threading.Event()

    def forget() -> None:
        erasing.set()
        with transaction(engine) as conn:
            erase(conn, "default", job, by="ann")

    thread = threading.Thread(target=forget)
    with transaction(engine) as conn:
        later = submit(conn, NewJob([new_item(0, PROMPT)])).id  # sees the features, and skips their stage
        thread.start()
        assert erasing.wait(10)
        thread.join(0.3)
        assert thread.is_alive()
        committed.set()
    thread.join(20)
    with transaction(engine) as conn:
        assert list_items(conn, "default", later).rows[0].stage == "generate"
        assert audit(conn) == []  # its features are there
        assert get_job(conn, "default", job).erased is not None


def test_only_what_has_ended_is_erased(engine: sa.Engine, folder_store: FolderStore) -> None:
    job = submit_items(engine, 1)
    with pytest.raises(Conflict, match="marey jobs cancel"), transaction(engine) as conn:
        erase(conn, "default", job, by="ann")
    with pytest.raises(NotFound), transaction(engine) as conn:
        erase(conn, "other", job, by="eve")


def test_a_file_that_cannot_be_read_goes_rather_than_keep_its_prompt(
    engine: sa.Engine, folder_store: FolderStore
) -> None:
    job = made(engine, folder_store, PROMPT, npz=b"broken " + PROMPT.encode())
    with transaction(engine) as conn:
        erase(conn, "default", job, by="ann")
    assert rewrite_files(engine, folder_store) == 1
    assert objects(folder_store) == [b"HIERARCHY"]


def test_a_job_goes_with_its_files_when_its_days_are_over(engine: sa.Engine, folder_store: FolderStore) -> None:
    kept, brief, open_one = (
        made(engine, folder_store, "a person walks", keep_days=30),
        made(engine, folder_store, "a person bows", keep_days=2),
        submit_items(engine, 1, keep_days=1),
    )
    assert delete_expired(engine, folder_store) == 0
    with transaction(engine) as conn:
        row = get_job(conn, "default", brief)
        assert row.expires is not None
        assert row.finished is not None
        assert (row.expires - row.finished).days == 2
        conn.execute(sa.text("UPDATE job SET finished_at = finished_at - interval '49 hours'"))
        conn.execute(sa.text("UPDATE job SET created_at = created_at - interval '99 days'"))
    before = len(objects(folder_store))
    assert delete_expired(engine, folder_store) == 1
    assert len(objects(folder_store)) == before - 1  # its npz; the bvh is the same as the other's
    with transaction(engine) as conn:
        assert get_job(conn, "default", kept).state is JobState.SUCCEEDED
        assert get_job(conn, "default", open_one).expires is None
        with pytest.raises(NotFound):
            get_job(conn, "default", brief)
        assert audit(conn) == []
    assert collect_garbage(engine, folder_store) == GarbageReport(0, 0, ())


def test_days_and_erasure_by_the_command_line(marey: Command, api: LiveApi, http: httpx2.Client) -> None:
    job = marey("submit", "a person walks", "--keep-days", 3, "--json").ok().lines[0]
    assert (job["keep_days"], job["expires"], job["erased"]) == (3, None, None)
    marey("jobs", "erase", job["id"], "--yes").refused(2, "the job is queued")
    api.work(walker(seconds=0.2).to_npz())
    assert "expires" in marey("jobs", "show", job["id"]).ok().out
    assert "1 files are written anew" in marey("jobs", "erase", job["id"], "--yes").ok().err
    with api.client() as client:
        (item,) = client.pages(f"/v1/jobs/{job['id']}/items")
    assert (item["prompt"], [file["format"] for file in item["motion"]["files"]]) == ("", ["bvh"])
    assert http.get(f"/v1/motions/{item['motion']['id']}/files/npz").status_code == 404
    marey("submit", "a person walks", "--keep-days", 0).refused(2)


def add_file(engine: sa.Engine, store: FolderStore, job: UUID, format: str, data: bytes) -> None:
    """Add a file to the motions of a job, as a worker with another exporter would."""
    store.put(asset_key("default", digest(data).sha256), data)
    with transaction(engine) as conn:
        asset = conn.execute(
            sa.text(
                "INSERT INTO asset (id, tenant_id, sha256, size, media_type, state, announced_at) VALUES "
                "(gen_random_uuid(), 'default', :sha256, :size, 'text/x-toy', 'stored', now()) RETURNING id"
            ),
            {"sha256": digest(data).sha256, "size": len(data)},
        ).scalar_one()
        conn.execute(
            sa.text("INSERT INTO motion_file (motion_id, format, asset_id) SELECT id, :format, :asset FROM motion "
                    "WHERE job_id = :job"),
            {"format": format, "asset": asset, "job": job},
        )  # fmt: skip


TOY = """
from marey.exporters import Exporter, exporter_of


def encode(clip, coordinates):
    return b"toy " + exporter_of("npz").encode(clip, coordinates)


def decode(data, where, coordinates):
    if data.startswith(b"bug"):
        raise RuntimeError("a bug of the plug-in")
    return exporter_of("npz").decode(data.removeprefix(b"toy "), where, coordinates)


HOLDS = Exporter("toy", "text/x-toy", "toy", True, encode, decode)
PLAIN = Exporter("toy", "text/x-toy", "toy", False, encode)
"""


def formats_served(engine: sa.Engine, job: UUID) -> list[str]:
    with transaction(engine) as conn:
        (row,) = list_items(conn, "default", job).rows
        return [] if row.motion is None else [file.format for file in row.motion.files]


def erased_with_toy(engine: sa.Engine, store: FolderStore, data: bytes) -> UUID:
    """A job with a file of a format that is not installed here, erased."""
    job = made(engine, store, PROMPT)
    add_file(engine, store, job, "toy", data)
    with transaction(engine) as conn:
        assert erase(conn, "default", job, by="ann").files_left == 2
    assert formats_served(engine, job) == ["bvh"]
    return job


def toy_plugin(folder: Path, name: str) -> Path:
    module = f"toy_{name.lower()}"
    return write_distribution(folder, module, {module: TOY}, f"[marey.exporters]\ntoy = {module}:{name}\n")


def test_a_format_that_is_not_installed_is_never_skipped_and_holds_up_no_other(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    toy = b"toy " + walker(seconds=0.2, prompt=PROMPT).to_npz()
    job = erased_with_toy(engine, folder_store, toy)
    for _ in range(2):
        with pytest.raises(ExceptionGroup, match="still hold their prompts") as raised:
            rewrite_files(engine, folder_store)
        assert [type(error) for error in raised.value.exceptions] == [PluginError]
        assert "'toy' is installed" in str(raised.value.exceptions[0])
        assert formats_served(engine, job) == ["bvh", "npz"]
        assert toy in objects(folder_store)
    with installed(toy_plugin(tmp_path, "HOLDS")):
        assert rewrite_files(engine, folder_store) == 1
    assert formats_served(engine, job) == ["bvh", "npz", "toy"]
    (rewritten,) = (data for data in objects(folder_store) if data.startswith(b"toy "))
    assert parse_npz(rewritten.removeprefix(b"toy ")).manifest == {"seed": 7, "erased": True}
    assert rewrite_files(engine, folder_store) == 0
    with transaction(engine) as conn:
        assert audit(conn) == []


def test_a_format_without_prompts_is_served_again_as_it_is(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    job = erased_with_toy(engine, folder_store, b"toy")
    with installed(toy_plugin(tmp_path, "PLAIN")):
        assert rewrite_files(engine, folder_store) == 2
        assert formats_served(engine, job) == ["bvh", "npz", "toy"]
        assert b"toy" in objects(folder_store)
        later = made(engine, folder_store, PROMPT)
        add_file(engine, folder_store, later, "toy", b"toy 2")
        with transaction(engine) as conn:
            assert erase(conn, "default", later, by="ann").files_left == 1
        assert formats_served(engine, later) == ["bvh", "toy"]


def test_a_format_without_prompts_serves_no_file_of_another_that_waits(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path
) -> None:
    job = made(engine, folder_store, PROMPT)
    for name in ("toy", "zoo"):
        add_file(engine, folder_store, job, name, f"{name} {PROMPT}".encode())
    with transaction(engine) as conn:
        assert erase(conn, "default", job, by="ann").files_left == 3
    with installed(toy_plugin(tmp_path, "PLAIN")), pytest.raises(ExceptionGroup) as raised:
        rewrite_files(engine, folder_store)
    assert "'zoo' is installed" in str(raised.value.exceptions[0])
    assert formats_served(engine, job) == ["bvh", "npz", "toy"]


def test_transactions_that_remove_files_have_time_for_it(
    engine: sa.Engine, folder_store: FolderStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They wait for the object store, and read many rows: an ordinary deadline would stop them again and again."""
    kinds: list[Deadline | None] = []

    def noted(engine: sa.Engine, deadline: Deadline | None = None, **more: bool) -> AbstractContextManager[Any]:
        kinds.append(deadline)
        return transaction(engine, deadline, **more)

    for module in (retention, gc):
        monkeypatch.setattr(module, "transaction", noted)
    job, late = made(engine, folder_store, PROMPT), made(engine, folder_store, "a person bows", keep_days=1)
    add_file(engine, folder_store, job, "toy", b"toy")
    with transaction(engine) as conn:
        erase(conn, "default", job, by="ann")
        old = "UPDATE job SET finished_at = finished_at - interval '49 hours' WHERE id = :job"
        conn.execute(sa.text(old), {"job": late})
    with installed(toy_plugin(tmp_path, "PLAIN")):
        assert rewrite_files(engine, folder_store) == 2
    assert delete_expired(engine, folder_store) == 1
    collect_garbage(engine, folder_store)
    assert set(kinds) == {MAINTENANCE, BULK}


def test_a_plugin_that_fails_is_tried_again(engine: sa.Engine, folder_store: FolderStore, tmp_path: Path) -> None:
    job = erased_with_toy(engine, folder_store, b"bug")
    with installed(toy_plugin(tmp_path, "HOLDS")), pytest.raises(ExceptionGroup) as raised:
        rewrite_files(engine, folder_store)
    assert raised.value.subgroup(RuntimeError) is not None
    assert formats_served(engine, job) == ["bvh", "npz"]
