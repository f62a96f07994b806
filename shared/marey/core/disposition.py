"""The `Content-Disposition` header of a download (RFC 6266), with names of any language."""

from __future__ import annotations

import re
import unicodedata
from urllib.parse import quote

MOST_BYTES = 200
"""Limit of the stem in UTF-8: file systems allow 255 bytes with the extension."""
_UNSAFE = re.compile(r'[\x00-\x1f\x7f-\x9f/\\:*?"<>|\ud800-\udfff]')
_PLAIN = re.compile(r"[^A-Za-z0-9!#$&+.^_`~ -]")
"""Characters that clients do not parse alike in a quoted string."""


def download_name(stem: str, ending: str) -> str:
    """Return a file name that every system accepts: no separators, no control characters, at most 255 bytes."""
    clean = _UNSAFE.sub("-", unicodedata.normalize("NFC", stem)).strip(" .") or "file"
    return f"{clean.encode()[:MOST_BYTES].decode(errors='ignore').rstrip(' .')}.{ending}"


def attachment(filename: str) -> str:
    """Return the header's value: the name in ASCII for old clients and, if it holds more, percent-encoded (RFC
    8187)."""
    folded = unicodedata.normalize("NFKD", filename).encode("ascii", "ignore").decode()
    plain = _PLAIN.sub("_", folded)
    if plain == filename:
        return f'attachment; filename="{plain}"'
    if not plain.partition(".")[0].strip(" _-"):
        plain = f"file.{plain.rpartition('.')[2]}"
    return f"attachment; filename=\"{plain}\"; filename*=UTF-8''{quote(filename, safe='')}"
