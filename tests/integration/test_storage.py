"""One contract for both asset stores; S3 is a real server (OpenStack Swift)."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
import threading
import time
import tracemalloc
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import urllib3

from marey.core.disposition import attachment
from marey.core.errors import InvalidInput, NotFound, Unreachable
from marey.core.settings import Settings
from marey.jobs import asset_key
from marey.storage import AssetStore, FolderStore, NewObject, deadlines, open_store
from marey.storage.s3 import S3Store
from tests.servers.swift import Swift


@pytest.fixture(params=["folder", "s3"])
def store(request: pytest.FixtureRequest) -> AssetStore:
    return request.getfixturevalue(f"{request.param}_store")


def key_of(content: bytes, tenant: str = "default") -> str:
    return asset_key(tenant, hashlib.sha256(content).hexdigest())


def test_what_was_put_comes_back(store: AssetStore) -> None:
    content = bytes(range(256)) * 100
    digest = store.put(key_of(content), content, media_type="model/x")
    assert digest.sha256 == hashlib.sha256(content).hexdigest()
    assert digest.size == len(content)
    assert store.get(key_of(content)) == content
    assert store.size(key_of(content)) == len(content)
    assert store.exists(key_of(content))


def test_a_file_of_many_megabytes_comes_back(store: AssetStore, tmp_path: Path) -> None:
    content = hashlib.shake_128(b"marey").digest(11 << 20)
    path = tmp_path / "large.npz"
    path.write_bytes(content)
    store.put(key_of(content), path)
    opened = store.open(key_of(content))
    assert opened.size == len(content)
    assert b"".join(opened.chunks) == content


@pytest.mark.parametrize(("start", "length"), [(0, None), (100, None), (0, 4096), (4000, 2**30)])
def test_a_small_file_takes_little_memory(folder_store: FolderStore, start: int, length: int | None) -> None:
    content = bytes(4096)
    folder_store.put(key_of(content), content)
    opened = folder_store.open(key_of(content), start, length)
    tracemalloc.start()
    try:
        assert b"".join(opened.chunks) == content[start:]
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2**16


def test_an_empty_object_is_an_object(store: AssetStore) -> None:
    store.put(key_of(b""), b"")
    assert store.get(key_of(b"")) == b""
    assert store.size(key_of(b"")) == 0


@pytest.mark.parametrize(("start", "length"), [(0, 1), (3, 4), (0, None), (7, None), (9, 100), (0, 10), (2, 0)])
def test_a_range_is_that_part(store: AssetStore, start: int, length: int | None) -> None:
    content = b"0123456789"
    store.put(key_of(content), content)
    opened = store.open(key_of(content), start, length)
    assert opened.size == 10
    assert b"".join(opened.chunks) == content[start : None if length is None else start + length]


def test_a_range_past_the_end_is_refused(store: AssetStore) -> None:
    store.put(key_of(b"0123456789"), b"0123456789")
    with pytest.raises(InvalidInput, match="byte 10 of 10"):
        store.open(key_of(b"0123456789"), 10)


def test_putting_again_changes_nothing(store: AssetStore) -> None:
    for _ in range(2):
        store.put(key_of(b"walk"), b"walk")
    assert store.get(key_of(b"walk")) == b"walk"
    assert list(store.keys()) == [key_of(b"walk")]


def test_content_other_than_its_key_says_is_refused(store: AssetStore) -> None:
    with pytest.raises(InvalidInput, match="SHA-256"):
        store.put(key_of(b"walk"), b"run")
    assert list(store.keys()) == []


def test_an_object_that_is_not_there_is_not_found(store: AssetStore) -> None:
    key = key_of(b"nothing")
    assert not store.exists(key)
    for read in (store.get, store.size, store.open):
        with pytest.raises(NotFound, match=key[-20:]):
            read(key)
    store.delete(key)


def test_a_deleted_object_is_gone(store: AssetStore) -> None:
    store.put(key_of(b"walk"), b"walk")
    store.delete(key_of(b"walk"))
    assert not store.exists(key_of(b"walk"))
    assert list(store.keys()) == []


def test_keys_come_in_order_and_by_prefix(store: AssetStore) -> None:
    contents = [f"motion {n}".encode() for n in range(12)]
    for n, content in enumerate(contents):
        store.put(key_of(content, "a" if n % 2 else "b"), content)
    expected = sorted(key_of(content, "a" if n % 2 else "b") for n, content in enumerate(contents))
    assert list(store.keys()) == expected
    assert list(store.keys("t/a/")) == [key for key in expected if key.startswith("t/a/")]
    assert list(store.keys("t/c/")) == []


@pytest.mark.parametrize(
    "key", ["", "/etc/passwd", "../secret", "t/../../secret", "t//x", "t/.incoming/x", "t\\x", "t/x\0", "t/ü", "t/x/"]
)
def test_a_key_that_leads_elsewhere_is_refused(store: AssetStore, key: str) -> None:
    for use in (store.get, store.exists, store.size, store.delete, store.open, lambda key: store.put(key, b"x")):
        with pytest.raises(InvalidInput, match="not a key"):
            use(key)


def test_sixteen_threads_put_at_once(store: AssetStore) -> None:
    contents = [f"motion {n % 4}".encode() * 1000 for n in range(16)]
    errors: list[BaseException] = []

    def put(content: bytes) -> None:
        try:
            store.put(key_of(content), content)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=put, args=(content,)) for content in contents]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert list(store.keys()) == sorted({key_of(content) for content in contents})


def test_a_batch_comes_back_and_tells_each_key(store: AssetStore) -> None:
    contents = [f"motion {n}".encode() * n for n in range(70)]
    told = list(store.put_all([NewObject(key_of(content), content, "model/x") for content in contents]))
    assert sorted(told) == sorted(map(key_of, contents))
    assert list(store.keys()) == sorted(told)
    assert all(store.get(key_of(content)) == content for content in contents)


def test_a_batch_may_hold_what_is_there_and_the_same_twice(store: AssetStore) -> None:
    store.put(key_of(b"walk"), b"walk")
    batch = [NewObject(key_of(content), content) for content in (b"walk", b"run", b"run")]
    assert set(store.put_all(batch)) == {key_of(b"walk"), key_of(b"run")}
    assert store.get(key_of(b"walk")) == b"walk"
    assert list(store.put_all([])) == []


def test_other_content_in_a_batch_is_refused(store: AssetStore) -> None:
    told: list[str] = []
    with pytest.raises(InvalidInput, match="SHA-256"):
        told.extend(store.put_all([NewObject(key_of(b"walk"), b"walk"), NewObject(key_of(b"run"), b"crawl")]))
    assert not store.exists(key_of(b"run"))


def test_a_store_that_works_passes_its_check_and_may_be_prepared_again(store: AssetStore) -> None:
    store.put(key_of(b"walk"), b"walk")
    store.prepare()
    store.check()
    assert store.get(key_of(b"walk")) == b"walk"


# --- the folder ---


def test_a_folder_that_cannot_be_written_is_unreachable(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    store = FolderStore(tmp_path / "file" / "assets")
    batch = [NewObject(key_of(b"x"), b"x")]
    for use in (store.check, lambda: store.put(key_of(b"x"), b"x"), lambda: list(store.put_all(batch))):
        with pytest.raises(Unreachable, match="MAREY_STORE"):
            use()


def test_a_put_that_fails_leaves_nothing_behind(folder_store: FolderStore, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput):
        folder_store.put(key_of(b"walk"), b"run")
    assert [path for path in folder_store.root.rglob("*") if path.is_file()] == []


def test_a_batch_that_fails_leaves_nothing_behind(folder_store: FolderStore, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    batch = [NewObject(key_of(content), content) for content in (b"walk", b"run")]
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", refuse)
        with pytest.raises(Unreachable, match="No space left"):
            list(folder_store.put_all(batch))
    assert [path for path in folder_store.root.rglob("*") if path.is_file()] == []
    assert len(list(folder_store.put_all(batch))) == 2


def test_a_key_is_told_when_its_file_and_every_folder_above_it_are_on_disk(
    folder_store: FolderStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files before they get their name, folders after what was made in them got its own."""
    synced: dict[int, list[str]] = {}

    def remember(descriptor: int) -> None:
        about = os.fstat(descriptor)
        entries = os.listdir(descriptor) if stat.S_ISDIR(about.st_mode) else []
        synced[about.st_ino] = entries

    monkeypatch.setattr(os, "fsync", remember)
    folder_store.prepare()
    for key in folder_store.put_all([NewObject(key_of(bytes([n])), bytes([n])) for n in range(70)]):
        path = folder_store.path(key)
        assert path.stat().st_ino in synced
        while path != folder_store.root:
            assert path.name in synced[path.parent.stat().st_ino]
            path = path.parent


def test_only_its_user_can_read_an_object(folder_store: FolderStore) -> None:
    folder_store.put(key_of(b"walk"), b"walk")
    assert stat.S_IMODE(folder_store.path(key_of(b"walk")).stat().st_mode) == 0o600


def test_preparing_removes_what_killed_writers_left_but_not_what_is_being_written(folder_store: FolderStore) -> None:
    folder_store.prepare()
    for name, age in (("old", 3700), ("new", 10)):
        left = folder_store.root / ".incoming" / name
        left.write_bytes(b"half")
        os.utime(left, (time.time() - age, time.time() - age))
    folder_store.prepare()
    assert [path.name for path in (folder_store.root / ".incoming").iterdir()] == ["new"]
    assert list(folder_store.keys()) == []


def test_a_folder_has_no_urls(folder_store: FolderStore) -> None:
    folder_store.put(key_of(b"walk"), b"walk")
    assert folder_store.presign(key_of(b"walk"), filename="walk.bvh", media_type="text/plain") is None


# --- S3 ---


def test_a_presigned_url_gives_the_object_under_its_name(s3_store: S3Store) -> None:
    s3_store.put(key_of(b"walk"), b"walk")
    url = s3_store.presign(key_of(b"walk"), filename='00001_wälk "1".bvh', media_type="application/x-bvh")
    assert url is not None
    response = urllib3.request("GET", url)
    assert (response.status, response.data) == (200, b"walk")
    assert response.headers["content-type"] == "application/x-bvh"
    assert response.headers["content-disposition"] == attachment('00001_wälk "1".bvh')


def test_a_tampered_presigned_url_gives_nothing(s3_store: S3Store) -> None:
    for content in (b"walk", b"run"):
        s3_store.put(key_of(content), content)
    url = s3_store.presign(key_of(b"walk"), filename="walk.bvh", media_type="text/plain")
    assert url is not None
    tampered = url.replace(key_of(b"walk"), key_of(b"run"))
    assert urllib3.request("GET", tampered, retries=False).status == 403


def test_presigned_urls_carry_the_public_endpoint_and_cost_no_request(swift: Swift) -> None:
    store = S3Store(swift.options("nowhere", endpoint="127.0.0.1:1", public_endpoint="assets.example:443"))
    url = store.presign(key_of(b"walk"), filename="walk.bvh", media_type="text/plain")
    assert url is not None
    assert urlsplit(url).netloc == "assets.example:443"


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"secret_key": "topsecret"}, ("does not accept the keys", "MAREY_S3_SECRET_KEY")),
        ({"access_key": "no:body"}, ("does not accept the keys", "MAREY_S3_ACCESS_KEY")),
        ({"region": "eu-nowhere-9"}, ("is in another region", "MAREY_S3_REGION")),
        ({"bucket": "no-such-bucket"}, ("has no such bucket", "MAREY_STORE")),
    ],
)
def test_a_store_that_is_set_up_wrongly_says_by_every_call_which_setting_it_is(
    swift: Swift, s3_store: S3Store, wrong: dict[str, str], said: tuple[str, str]
) -> None:
    s3_store.put(key_of(b"walk"), b"walk")
    store = S3Store(swift.options(**{"bucket": s3_store.options.bucket, **wrong}))
    for use in (
        store.check,
        lambda: store.put(key_of(b"x"), b"x"),
        lambda: list(store.put_all([NewObject(key_of(b"x"), b"x")] * 3)),
        lambda: store.get(key_of(b"walk")),
        lambda: store.size(key_of(b"walk")),
        lambda: store.exists(key_of(b"walk")),
        lambda: store.delete(key_of(b"walk")),
        lambda: list(store.keys()),
    ):
        with pytest.raises(Unreachable) as caught:
            use()
        assert all(words in str(caught.value) for words in said)
        assert "topsecret" not in str(caught.value)
    assert list(s3_store.keys()) == [key_of(b"walk")]


def test_an_outage_is_told_and_passes(swift: Swift, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(deadlines, "RETRIES", 1)
    store = swift.new_store()
    store.put(key_of(b"walk"), b"walk")
    swift.stop()
    try:
        for use in (
            store.check,
            lambda: store.put(key_of(b"run"), b"run"),
            lambda: list(store.put_all([NewObject(key_of(b"run"), b"run")] * 20)),
            lambda: store.get(key_of(b"walk")),
            lambda: store.exists(key_of(b"walk")),
            lambda: list(store.keys()),
        ):
            with pytest.raises(Unreachable, match=swift.endpoint):
                use()
    finally:
        swift.start()
    assert store.get(key_of(b"walk")) == b"walk"


# --- the choice ---


def test_a_bucket_at_its_byte_limit_takes_nothing_says_so_and_goes_on_when_there_is_room(swift: Swift) -> None:
    store = swift.new_store()
    swift.limit(store.options.bucket, 1500)
    store.put(key_of(b"a" * 1000), b"a" * 1000)
    more = [NewObject(key_of(content), content) for content in (b"b" * 1000, b"c" * 1000)]
    with pytest.raises(Unreachable, match=r"quota.*\n.*free space"):
        list(store.put_all(more))
    assert list(store.keys()) == [key_of(b"a" * 1000)]
    swift.limit(store.options.bucket, None)
    assert sorted(store.put_all(more)) == sorted(one.key for one in more)


def test_settings_choose_the_store(tmp_path: Path) -> None:
    assert isinstance(open_store(Settings(home=tmp_path)), FolderStore)
    chosen = open_store(Settings(store="s3://clips", s3_access_key="a", s3_secret_key="b"))  # pyright: ignore
    assert isinstance(chosen, S3Store)
    assert chosen.options.bucket == "clips"
    with pytest.raises(InvalidInput, match="MAREY_S3_ACCESS_KEY"):
        open_store(Settings(store="s3://clips"))
    with pytest.raises(InvalidInput, match="s3://bucket or a folder"):
        open_store(Settings(store="gs://clips"))
