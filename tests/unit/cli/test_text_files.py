"""Files of prompts that are packed, far too large, or nothing of the kind: refused early, in little memory."""

from __future__ import annotations

import gzip
import io
import subprocess
import sys
from pathlib import Path

import pytest

from marey.client import rows
from marey.client.rows import read_evaluation_prompts
from marey.client.text_files import MAX_LINE
from marey.core.errors import InvalidFile, InvalidInput, MareyError, TooLarge
from marey.items.item import MAX_BODY_BYTES, MAX_ITEMS, Item
from marey.items.problems import InvalidItems
from tests.support.rows import items_of

CSV = b"prompt,seed\na person walks,1\na person bows,2\n"
PACKED = gzip.compress(CSV, mtime=0)
"""Without the time it is made at: two processes that collect the tests must find the same ones."""
ITEMS = [Item("a person walks", seed=1), Item("a person bows", seed=2)]
MEMORY_MIB = 64
"""Memory that reading may add. The text limit alone is that, decoded it would be up to four times as much."""
MEASURED = """
import re, sys
from pathlib import Path
from marey.client.rows import read_file, right_items
from marey.core.errors import TooLarge
def peak():  # of this program alone: ru_maxrss begins at what the parent had
    return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])
before = peak()
try:
    list(right_items(read_file(sys.argv[1])))
except TooLarge as error:
    print(error)
print((peak() - before) // 1024)
"""
on_linux = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def written(folder: Path, name: str, content: bytes) -> str:
    path = folder / name
    path.write_bytes(content)
    return str(path)


def refusal(folder: Path, name: str, content: bytes, kind: type[MareyError] = TooLarge) -> str:
    with pytest.raises(kind) as caught:
        items_of(written(folder, name, content))
    assert caught.value.hint is not None
    return str(caught.value)


def read_in_a_child(path: str) -> tuple[str, int]:
    """The error for a file that is too large, and the growth of the process in MiB while reading it."""
    ran = subprocess.run([sys.executable, "-c", MEASURED, path], capture_output=True, text=True, check=True)
    said, _, grown = ran.stdout.strip().rpartition("\n")
    return said, int(grown)


@pytest.mark.parametrize("name", ["p.csv.gz", "P.CSV.GZ", "p.csv"])
def test_a_packed_file_is_read_like_the_file_in_it(tmp_path: Path, name: str) -> None:
    assert items_of(written(tmp_path, name, gzip.compress(CSV))) == ITEMS


def test_a_packed_file_may_have_several_members_and_a_mark_of_its_encoding(tmp_path: Path) -> None:
    half = len(CSV) // 2
    content = gzip.compress(b"\xef\xbb\xbf" + CSV[:half]) + gzip.compress(CSV[half:])
    assert items_of(written(tmp_path, "p.csv.gz", content)) == ITEMS


def test_a_packed_file_on_stdin_is_known_by_its_first_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(gzip.compress(CSV))))
    assert items_of("-") == ITEMS


def test_a_packed_file_of_an_evaluation_is_read_too(tmp_path: Path) -> None:
    content = gzip.compress(b"prompt,seconds\na person walks,2\na person runs,3\n")
    assert len(read_evaluation_prompts(written(tmp_path, "p.csv.gz", content))[0]) == 2


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("p.csv.gz", CSV, "is not packed by gzip"),
        ("p.csv.gz", PACKED[:-9], "cannot be unpacked"),
        ("p.csv.gz", PACKED[:12], "cannot be unpacked"),
        ("p.csv.gz", PACKED[:-8] + b"\0" * 8, "cannot be unpacked"),
        ("p.csv.gz", b"\x1f\x8b" + b"\xff" * 40, "cannot be unpacked"),
        ("p.csv.gz", gzip.compress(CSV.decode().encode("utf-16"), mtime=0), "is UTF-16"),
        ("p.csv.gz", gzip.compress(CSV + b"gar\xe7on\n", mtime=0), "line 4: is not UTF-8"),
        ("p.csv", b"PK\x03\x04" + b"\0" * 40, "a ZIP archive or a workbook"),
        ("p.csv", CSV.decode().encode("utf-16-le"), "control character|NUL|not a known column"),
    ],
    ids=["plain", "no end", "a header alone", "another sum", "noise", "UTF-16", "Latin-1", "ZIP", "UTF-16 unpacked"],
)
def test_what_is_no_text_says_what_it_is(tmp_path: Path, name: str, content: bytes, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        items_of(written(tmp_path, name, content))


def test_a_wrong_byte_far_down_is_told_with_its_line(tmp_path: Path) -> None:
    lines = [b"prompt", *[b"a person walks %d steps" % n for n in range(3000)], b"gar\xe7on"]
    with pytest.raises(InvalidFile, match="line 3002: is not UTF-8"):
        items_of(written(tmp_path, "p.csv", b"\r\n".join(lines)))


@on_linux
def test_a_packed_file_that_unpacks_to_gigabytes_is_refused_in_little_memory(tmp_path: Path) -> None:
    path = written(tmp_path, "p.csv.gz", gzip.compress(b'prompt\n"') + 2048 * gzip.compress(b"a" * 2**20))
    assert Path(path).stat().st_size < 4 * 2**20
    said, grown = read_in_a_child(path)
    assert "line 2: is over 1,048,576 characters" in said
    assert grown < MEMORY_MIB


def test_a_packed_file_of_blank_lines_is_refused_by_its_ratio(tmp_path: Path) -> None:
    said = refusal(tmp_path, "p.csv.gz", gzip.compress(b"prompt\n" + (b" " * 1000 + b"\n") * 10_000))
    assert "unpacks to more than 200 times its size" in said


def test_text_over_the_limit_is_refused_packed_or_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows, "MAX_BODY_BYTES", 2**20)
    content = b"prompt\n" + b",\n".join(b"%012d" % n for n in range(90_000))
    for name, given in (("p.csv", content), ("p.csv.gz", gzip.compress(content))):
        assert "is over 1 MiB of text" in refusal(tmp_path, name, given)


def test_a_file_over_the_limit_is_not_even_read(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    with path.open("wb") as stream:
        stream.truncate(MAX_BODY_BYTES + 1)
    with pytest.raises(TooLarge, match="is over 64 MiB"):
        items_of(str(path))


@on_linux
def test_a_csv_of_a_million_lines_is_refused_at_the_limit_in_little_memory(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    with path.open("w") as stream:
        stream.write("prompt\n")
        stream.writelines(f"a person walks {n} steps\n" for n in range(1_000_000))
    said, grown = read_in_a_child(str(path))
    assert f"line {MAX_ITEMS + 2}: is over the limit of 100,000 motions" in said
    assert "several jobs" in said
    assert grown < 2 * MEMORY_MIB  # a hundred thousand items among it


def test_variants_count_towards_the_limit(tmp_path: Path) -> None:
    lines = b"".join(b"a person walks,100\n" for _ in range(1001))
    assert "line 1002: is over the limit" in refusal(tmp_path, "p.csv", b"prompt,variants\n" + lines)


def test_a_line_without_an_end_is_refused(tmp_path: Path) -> None:
    said = refusal(tmp_path, "p.txt", b"a person walks\n" + b"walk " * (MAX_LINE // 4))
    assert "line 2: is over 1,048,576 characters" in said


def test_a_quote_that_is_never_closed_is_told_as_that(tmp_path: Path) -> None:
    for tail in (b"", b"\na person walks" * 20_000):
        with pytest.raises(InvalidItems, match=r"line 3: is not CSV: .*a quote is never closed"):
            items_of(written(tmp_path, "p.csv", b'prompt\na person walks\n"a person bows' + tail))


def test_lines_of_old_macs_are_lines(tmp_path: Path) -> None:
    assert items_of(written(tmp_path, "p.csv", CSV.replace(b"\n", b"\r"))) == ITEMS
