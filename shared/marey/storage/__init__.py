"""Asset stores: one interface, implemented by a folder and by S3.

store = open_store(settings())
digest = asset_digest(path)
store.put(key, path)
"""

from __future__ import annotations

from pathlib import Path

from marey.core.errors import InvalidInput
from marey.core.settings import Settings
from marey.storage.folder import FolderStore
from marey.storage.port import CHUNK, PRESIGN_SECONDS, AssetStore, Digest, NewObject, Opened, asset_digest

__all__ = [
    "CHUNK",
    "PRESIGN_SECONDS",
    "AssetStore",
    "Digest",
    "FolderStore",
    "NewObject",
    "Opened",
    "asset_digest",
    "open_store",
]


def open_store(chosen: Settings) -> AssetStore:
    """Open the store that the settings name: `s3://bucket`, a folder, or `home/assets`.

    Raises:
        InvalidInput: an S3 store without keys, or an unknown kind of URL.
    """
    where = chosen.store
    if where is None:
        return FolderStore(chosen.home / "assets")
    if not where.startswith("s3://"):
        if "://" in where:
            raise InvalidInput(f"{where!r} is not an asset store", where="MAREY_STORE", hint="s3://bucket or a folder.")
        return FolderStore(Path(where).expanduser())
    if chosen.s3_access_key is None or chosen.s3_secret_key is None:
        raise InvalidInput(
            "an S3 store needs its keys",
            where="MAREY_STORE",
            hint="Set MAREY_S3_ACCESS_KEY and MAREY_S3_SECRET_KEY (or the _FILE of each).",
        )
    from marey.storage.s3 import S3Options, S3Store  # importing minio costs 0.2 s; the folder store avoids it

    return S3Store(
        S3Options(
            endpoint=chosen.s3_endpoint,
            bucket=where.removeprefix("s3://").strip("/"),
            access_key=chosen.s3_access_key.get_secret_value(),
            secret_key=chosen.s3_secret_key.get_secret_value(),
            region=chosen.s3_region,
            secure=chosen.s3_secure,
            public_endpoint=chosen.s3_public_endpoint,
            ca_file=chosen.ca_file,
        )
    )
