"""Damaged copies of files: flipped bytes, cut ends, changed counts, indices, offsets and numbers."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from random import Random

WORDS = (0, 1, 2**16, 2**31 - 1, 2**31, 2**32 - 1)
NUMBERS = (b"0", b"-1", b"1e308", b"-1e39", b"1e999", b"2147483648", b"99999999999999999999", b"NaN", b"null", b"0.5")
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def damaged(data: bytes, random: Random) -> bytes:
    """Bytes that are cut, flipped, replaced by a count of 32 or 64 bits, doubled or left out."""
    kind, size = random.randrange(5), len(data)
    if kind == 0:
        return data[: random.randrange(size)]
    changed = bytearray(data)
    if kind == 1:
        for _ in range(random.randint(1, 20)):
            changed[random.randrange(size)] = random.randrange(256)
    elif kind == 2:
        at, width = random.randrange(max(1, size - 8)), random.choice((4, 8))
        changed[at : at + width] = random.choice(WORDS).to_bytes(width, "little")
    elif kind == 3:  # among the counts and offsets that stand first in most formats
        at = random.randrange(min(size, 4096))
        changed[at : at + 4] = random.choice(WORDS).to_bytes(4, "little")
    else:
        at, length = random.randrange(size), random.randint(1, 200)
        changed[at : at + length] = changed[at : at + length] * 2 if random.random() < 0.5 else b""
    return bytes(changed)


def damaged_text(data: bytes, random: Random) -> bytes:
    """As `damaged`, or with other numbers."""
    if random.random() < 0.4:
        return damaged(data, random)
    for _ in range(random.randint(1, 3)):
        if found := NUMBER.search(data, random.randrange(len(data))):
            data = data[: found.start()] + random.choice(NUMBERS) + data[found.end() :]
    return data


def damaged_glb(data: bytes, random: Random) -> bytes:
    """As `damaged`, or with other numbers in the JSON of a glb whose chunks stay whole."""
    if random.random() < 0.4:
        return damaged(data, random)
    size = struct.unpack_from("<I", data, 12)[0]
    document, rest = damaged_text(data[20 : 20 + size], random), data[20 + size :]
    document += b" " * (-len(document) % 4)
    return data[:8] + struct.pack("<II", 20 + len(document) + len(rest), len(document)) + b"JSON" + document + rest


def damaged_npz(data: bytes, random: Random) -> bytes:
    """As `damaged`, or with a damaged array in an archive that stays whole."""
    if random.random() < 0.4:
        return damaged(data, random)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        arrays = {name: archive.read(name) for name in archive.namelist()}
    name = random.choice(sorted(arrays))
    head, rest = arrays[name][:128], arrays[name][128:]
    arrays[name] = damaged_text(head, random) + rest if random.random() < 0.7 else damaged(arrays[name], random)
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w") as archive:
        for each, content in arrays.items():
            archive.writestr(each, content)
    return written.getvalue()
