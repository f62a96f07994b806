"""The asset store on S3, by the `minio` SDK."""

from __future__ import annotations

import io
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

import urllib3
from minio import Minio
from minio.error import InvalidResponseError, MinioException, S3Error, ServerError

from marey.core.disposition import attachment
from marey.core.errors import Unreachable
from marey.core.metrics import STORE_ERRORS
from marey.core.tls import UNTRUSTED_HINT, trusting_context, verification_error
from marey.storage.deadlines import Silence, open_pool
from marey.storage.port import (
    CHUNK,
    PRESIGN_SECONDS,
    PUBLIC,
    Digest,
    NewObject,
    Opened,
    asset_digest,
    check_content,
    checked_key,
    no_such_object,
    range_past_end,
)

PROBE = "doctor/none"
"""Codes for a missing object."""
PUTS_AT_ONCE = 8  # parallel uploads of one batch; half of the pool's connections
MISSING = frozenset({"NoSuchKey", "404"})
WORDLESS = frozenset({"AccessDenied", "BadRequest"})
"""Codes that the SDK invents for an answer without a body, such as that to a HEAD."""
NO_BUCKET = "NoSuchBucket"
_KEYS = "does not accept the keys", "Check MAREY_S3_ACCESS_KEY and MAREY_S3_SECRET_KEY."
_REGION = "is in another region", "Set MAREY_S3_REGION to that of the bucket."
_FULL = "is full", "Free space, or raise the quota of the bucket; failed uploads are retried."
REASONS = {
    "SignatureDoesNotMatch": _KEYS,
    "InvalidAccessKeyId": _KEYS,
    "AuthorizationHeaderMalformed": _REGION,
    "PermanentRedirect": _REGION,
    NO_BUCKET: ("has no such bucket", "Check MAREY_STORE; `marey admin migrate` makes the bucket."),
    "AccessDenied": (
        "denies these keys access",
        "Allow them to read, write, list and delete objects of the bucket, or check MAREY_S3_ACCESS_KEY.",
    ),
    "RequestTimeTooSkewed": ("has a clock that differs from this machine's", "Synchronize both clocks (NTP)."),
    "QuotaExceeded": _FULL,
    "InsufficientStorage": _FULL,
    "XMinioStorageFull": _FULL,
    "XMinioAdminBucketQuotaExceeded": _FULL,
}
"""Problem and advice by the code of the store's answer."""


@dataclass(frozen=True)
class S3Options:
    """Connection options of the store.

    Attributes:
        endpoint: `http://host:port`, `https://host`, or `host:port`.
        secure: use https for an endpoint without a scheme.
        public_endpoint: address in presigned URLs, where clients reach the store under another name or scheme.
        ca_file: PEM file of certificate authorities to trust beside the machine's own.
    """

    endpoint: str
    bucket: str
    access_key: str
    secret_key: str
    region: str = "us-east-1"
    secure: bool = False
    public_endpoint: str | None = None
    ca_file: Path | None = None

    def address(self, endpoint: str) -> tuple[str, bool]:
        """Split an endpoint into host with port, and whether https is used."""
        scheme, separator, host = endpoint.rpartition("://")
        return host.rstrip("/"), scheme == "https" if separator else self.secure


class S3Store:
    """Objects of one bucket. One client per process, shared by its threads."""

    def __init__(self, options: S3Options) -> None:
        self.options = options
        self._silence = Silence()
        self._client = _client(options, options.endpoint, self._silence)
        self._puts = ThreadPoolExecutor(PUTS_AT_ONCE, thread_name_prefix="put")
        public = options.public_endpoint or options.endpoint
        self._public = self._client if public == options.endpoint else _client(options, public, self._silence)

    def prepare(self) -> None:
        """See `AssetStore.prepare`. Unfinished multipart uploads are left to the bucket's lifecycle rules."""
        bucket = self.options.bucket
        with self._outages():
            if self._client.bucket_exists(bucket):
                return
            try:
                self._client.make_bucket(bucket)
            except S3Error as error:
                if error.code not in {"BucketAlreadyOwnedByYou", "BucketAlreadyExists"}:  # another process created it
                    raise

    def put(self, key: str, source: bytes | Path, *, media_type: str = "application/octet-stream") -> Digest:
        """See `AssetStore.put`."""
        checked_key(key)
        digest = asset_digest(source)
        check_content(key, digest)
        with self._outages():
            if isinstance(source, bytes):
                self._client.put_object(
                    self.options.bucket, key, io.BytesIO(source), digest.size, content_type=media_type
                )
            else:
                self._client.fput_object(self.options.bucket, key, str(source), content_type=media_type)
        return digest

    def put_all(self, objects: Sequence[NewObject]) -> Iterator[str]:
        """See `AssetStore.put_all`. After an error, uploads that have not begun are skipped."""
        keys = {
            self._puts.submit(self.put, one.key, one.content, media_type=one.media_type): one.key for one in objects
        }
        errors: list[BaseException] = []
        for future in as_completed(keys):
            if future.cancelled():
                continue
            if (error := future.exception()) is None:
                yield keys[future]
            else:
                errors.append(error)
                for waiting in keys:
                    waiting.cancel()
        if errors:
            raise errors[0]

    def get(self, key: str) -> bytes:
        """See `AssetStore.get`."""
        return b"".join(self.open(key).chunks)

    def open(self, key: str, start: int = 0, length: int | None = None) -> Opened:
        """See `AssetStore.open`."""
        size = self.size(key)
        if start > size or (start == size and size > 0):
            raise range_past_end(key, start, size)
        wanted = size - start if length is None else min(length, size - start)
        return Opened(size, self._chunks(key, start, wanted) if wanted else iter(()))

    def exists(self, key: str) -> bool:
        """See `AssetStore.exists`."""
        with self._outages():
            try:
                self._client.stat_object(self.options.bucket, checked_key(key))
            except S3Error as error:
                if error.code in MISSING and self._client.bucket_exists(self.options.bucket):
                    return False
                raise
        return True

    def size(self, key: str) -> int:
        """See `AssetStore.size`."""
        with self._outages(key):
            return self._client.stat_object(self.options.bucket, checked_key(key)).size or 0

    def delete(self, key: str) -> None:
        """See `AssetStore.delete`."""
        with self._outages():
            self._client.remove_object(self.options.bucket, checked_key(key))

    def keys(self, prefix: str = "") -> Iterator[str]:
        """See `AssetStore.keys`."""
        with self._outages():
            for found in self._client.list_objects(self.options.bucket, prefix=prefix, recursive=True):
                if found.object_name is not None:
                    yield found.object_name

    def presign(self, key: str, *, filename: str, media_type: str, seconds: int = PRESIGN_SECONDS) -> str | None:
        """See `AssetStore.presign`. Computed locally: no request is made."""
        return self._public.presigned_get_object(
            self.options.bucket,
            checked_key(key),
            expires=timedelta(seconds=seconds),
            response_headers={
                "response-content-disposition": attachment(filename),
                "response-content-type": media_type,
            },
        )

    def check(self) -> None:
        """See `AssetStore.check`."""
        with self._outages():
            if not self._client.bucket_exists(self.options.bucket):
                raise self._because(NO_BUCKET)

    def _chunks(self, key: str, start: int, length: int) -> Iterator[bytes]:
        with self._outages(key):
            response = self._client.get_object(self.options.bucket, key, offset=start, length=length)
            try:
                read = 0
                for chunk in response.stream(CHUNK):
                    read += len(chunk)
                    yield chunk
            finally:
                response.close()
                response.release_conn()
            if read != length:
                raise Unreachable(
                    f"the connection ended after {read} of {length} bytes", where=self._where(key), public=PUBLIC
                )

    def _where(self, key: str | None = None) -> str:
        host, _ = self.options.address(self.options.endpoint)
        return "/".join(filter(None, (f"s3://{host}", self.options.bucket, key)))

    @contextmanager
    def _outages(self, key: str | None = None) -> Generator[None]:
        """Convert errors of the SDK to `NotFound` (of `key`) or `Unreachable`."""
        try:
            yield
        except Unreachable:
            STORE_ERRORS.labels("s3").inc()
            raise
        except S3Error as error:
            precise = self._refined(error)
            if key is not None and precise.code in MISSING:
                raise no_such_object(key) from error
            raise self._because(precise.code or "", precise.message) from error
        except (ServerError, InvalidResponseError, MinioException) as error:
            raise self._unreachable(str(error).splitlines()[0]) from error
        except (urllib3.exceptions.HTTPError, OSError) as error:
            if (why := verification_error(error)) is not None:
                raise self._untrusted(why) from error
            self._silence.note(error)  # within an object, where no retry applies
            cause = getattr(error, "reason", None) or error
            raise self._unreachable(f"{type(cause).__name__}: {cause}", what="does not answer") from error

    def _refined(self, error: S3Error) -> S3Error:
        """Return the error, or a more precise one: the answer to a HEAD names neither a missing bucket nor invalid
        keys, so the request is repeated as a GET."""
        try:
            if error.code in MISSING and self._client.bucket_exists(self.options.bucket):
                return error
            if error.code in MISSING | WORDLESS:
                self._client.get_object(self.options.bucket, PROBE).release_conn()
        except S3Error as better:
            return error if better.code in MISSING else better
        except (MinioException, urllib3.exceptions.HTTPError, OSError):
            pass  # unreachable by now: report the first error
        return error

    def _because(self, code: str, message: str | None = None) -> Unreachable:
        """Return the error for an answer of the store."""
        what, hint = REASONS.get(code, (None, None))
        if what is None or hint is None:
            return self._unreachable(f"{code}: {message}")
        STORE_ERRORS.labels("s3").inc()
        return Unreachable(
            f"the object store {what} ({message or code})", where=self._where(), hint=hint, public=PUBLIC
        )

    def _untrusted(self, why: str) -> Unreachable:
        STORE_ERRORS.labels("s3").inc()
        message = f"the certificate of the object store is not trusted ({why})"
        return Unreachable(message, where=self._where(), hint=UNTRUSTED_HINT, public=PUBLIC)

    def _unreachable(self, cause: str, *, what: str = "failed") -> Unreachable:
        STORE_ERRORS.labels("s3").inc()
        return Unreachable(
            f"the object store {what} ({cause})",
            where=self._where(),
            hint="Is it running, has it free space, and are MAREY_S3_ENDPOINT (with its scheme) and the keys right?",
            public=PUBLIC,
        )


def _client(options: S3Options, endpoint: str, silence: Silence) -> Minio:
    host, secure = options.address(endpoint)
    return Minio(
        host,
        access_key=options.access_key,
        secret_key=options.secret_key,
        region=options.region,  # otherwise presigning requests it from the network
        secure=secure,
        http_client=open_pool(silence, trusting_context(options.ca_file) if secure else None),
    )
