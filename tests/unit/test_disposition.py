"""Names of downloads in `Content-Disposition`."""

from __future__ import annotations

from email.message import Message
from urllib.parse import unquote

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from marey.core.disposition import attachment, download_name


def named(header: str) -> str:
    """The file name that a client of RFC 6266 reads."""
    message = Message()
    message["Content-Disposition"] = header
    return message.get_filename()


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("00001_walk_7.npz", 'attachment; filename="00001_walk_7.npz"'),
        ("Café.bvh", "attachment; filename=\"Cafe.bvh\"; filename*=UTF-8''Caf%C3%A9.bvh"),
        ("歩く.npz", "attachment; filename=\"file.npz\"; filename*=UTF-8''%E6%AD%A9%E3%81%8F.npz"),
        ("a'b;c.npz", "attachment; filename=\"a_b_c.npz\"; filename*=UTF-8''a%27b%3Bc.npz"),
    ],
)
def test_a_name_stands_in_ascii_and_if_need_be_in_utf_8(name: str, header: str) -> None:
    assert attachment(name) == header


@given(st.text(max_size=300))
@example("x\r\nSet-Cookie: a=b")
@example('"; filename="other.exe')
@example("…/..\\..")
@example("\ud800")
def test_any_name_arrives_and_stays_in_its_header_and_folder(stem: str) -> None:
    name = download_name(stem, "npz")
    header = attachment(name)
    assert header.isascii()
    assert header.isprintable()
    assert named(header) == name or unquote(header.rpartition("''")[2]) == name
    assert not set(name) & set('/\\\r\n\x00"')
    assert len(name.encode()) <= 255
    assert name.rpartition(".")[0] not in {"", ".", ".."}
