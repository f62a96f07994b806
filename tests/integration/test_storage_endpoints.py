"""The object store inside and outside: other names, other schemes, and a certificate authority of its own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import httpx2
import pytest
from pydantic import SecretStr

from marey.core.errors import InvalidInput, Unreachable
from marey.core.settings import Settings
from marey.core.tls import context_for, trusting_context
from marey.storage import open_store
from marey.storage.s3 import S3Options, S3Store
from tests.servers.receiver import Authority
from tests.servers.swift import ACCESS_KEY, SECRET_KEY, Swift
from tests.servers.tls_front import TlsFront

CONTENT = b"motion" * 1000


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority.make(tmp_path_factory.mktemp("authority"))


@pytest.fixture(scope="module")
def front(swift: Swift, authority: Authority) -> Iterator[TlsFront]:
    """The S3 server by https."""
    host, _, port = swift.endpoint.partition(":")
    with TlsFront(authority.server("localhost"), (host, int(port))) as front:
        yield front


def test_signed_urls_have_the_public_scheme_and_host(swift: Swift, front: TlsFront, authority: Authority) -> None:
    config = Settings(
        store=f"s3://{swift.new_store().options.bucket}",
        s3_endpoint=f"http://{swift.endpoint}",
        s3_public_endpoint=f"https://localhost:{front.port}",
        s3_access_key=SecretStr(ACCESS_KEY),
        s3_secret_key=SecretStr(SECRET_KEY),
    )
    store = open_store(config)
    store.put("t/x", CONTENT)
    assert front.connections == 0  # the inner endpoint was used
    signed = store.presign("t/x", filename="x.npz", media_type="x/y")
    assert signed is not None
    assert urlsplit(signed)[:2] == ("https", f"localhost:{front.port}")
    with httpx2.Client(verify=trusting_context(authority.file)) as client:
        answer = client.get(signed)
    assert answer.content == CONTENT
    assert front.connections == 1


def test_a_client_of_an_http_server_reads_authorities_at_its_first_tls_connection(
    swift: Swift, front: TlsFront, authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("SSL_CERT_FILE", "SSL_CERT_DIR"):
        monkeypatch.delenv(name, raising=False)
    url = f"https://localhost:{front.port}/"
    with httpx2.Client(verify=context_for("http://localhost")) as client:
        assert client.get(f"http://{swift.endpoint}/").status_code
        monkeypatch.setenv("SSL_CERT_FILE", str(authority.file))
        assert client.get(url).status_code
    monkeypatch.delenv("SSL_CERT_FILE")
    client = httpx2.Client(verify=context_for("http://localhost"))
    with client, pytest.raises(httpx2.ConnectError, match="CERTIFICATE_VERIFY_FAILED"):
        client.get(url)


def test_the_store_may_be_reached_by_https_inside_and_http_outside(
    swift: Swift, front: TlsFront, authority: Authority
) -> None:
    bucket = swift.new_store().options.bucket
    inner, outer = f"https://localhost:{front.port}", f"http://{swift.endpoint}"
    options = swift.options(bucket, endpoint=inner, public_endpoint=outer, ca_file=authority.file)
    store = S3Store(options)
    before = front.connections
    store.put("t/x", CONTENT)
    assert store.get("t/x") == CONTENT
    assert front.connections > before
    signed = store.presign("t/x", filename="x.npz", media_type="x/y")
    assert signed is not None
    assert signed.startswith(outer)
    assert httpx2.get(signed).content == CONTENT


def test_a_store_with_an_unknown_authority_is_refused_with_what_to_set(swift: Swift, front: TlsFront) -> None:
    store = S3Store(swift.options("marey", endpoint=f"localhost:{front.port}", secure=True))
    with pytest.raises(Unreachable, match="certificate of the object store is not trusted") as refused:
        store.check()
    assert "MAREY_CA_FILE" in (refused.value.hint or "")
    assert refused.value.where == f"s3://localhost:{front.port}/marey"


@pytest.mark.parametrize(
    ("endpoint", "secure", "address"),
    [
        ("objects:9000", False, ("objects:9000", False)),
        ("objects:9000", True, ("objects:9000", True)),
        ("http://objects:9000", True, ("objects:9000", False)),
        ("https://objects.example.com/", False, ("objects.example.com", True)),
        ("https://[::1]:9000", False, ("[::1]:9000", True)),
    ],
)
def test_a_scheme_of_its_own_comes_before_the_flag(endpoint: str, secure: bool, address: tuple[str, bool]) -> None:
    options = S3Options(endpoint, "marey", ACCESS_KEY, SECRET_KEY, secure=secure)
    assert options.address(endpoint) == address


def test_an_authority_file_that_cannot_be_used_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidInput, match="cannot be read"):
        trusting_context(tmp_path / "none.pem")
    (tmp_path / "empty.pem").write_text("no certificate")
    with pytest.raises(InvalidInput, match="holds no certificate"):
        trusting_context(tmp_path / "empty.pem")
    for name in ("none.pem", "empty.pem"):
        monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / name))
        with pytest.raises(InvalidInput, match=f"SSL_CERT_FILE: .*{name}"):
            trusting_context()
