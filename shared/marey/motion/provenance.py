"""Check of manifests: the entries that operations on motions read have the form in which Marey writes them.

A manifest comes from a file, and files may be forged or damaged. All other entries are passed on as they are.
Standard library only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, cast

from marey.core.errors import InvalidFile

SPANS = ("rows", "transitions", "gaps")
"""Lists of a timeline, of objects with `start` and `end` in seconds."""


def check_manifest(manifest: object, where: str) -> dict[str, Any]:
    """Return the manifest of a motion; each of these entries may be missing.

    Raises:
        InvalidFile: it is no object, or an entry has another form.
    """
    if not isinstance(manifest, dict):
        raise InvalidFile("`manifest` is not a JSON object", where=where)
    manifest = cast("dict[str, Any]", manifest)
    for name, (is_valid, form) in ENTRIES.items():
        if name in manifest and not is_valid(manifest[name]):
            raise InvalidFile(f"`{name}` of the manifest is not {form}", where=where)
    return manifest


def _is_text(value: object) -> bool:
    """Return True for text, and for null: none is known."""
    return value is None or isinstance(value, str)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _are_prompts(value: object) -> bool:
    firsts: list[int] = []
    for entry in cast("list[object]", value) if _is_list(value) else [None]:
        match entry:
            case [int(first), str()] if first >= 0:
                firsts.append(first)
            case _:
                return False
    return firsts == sorted(firsts)


def _is_timeline(value: object) -> bool:
    record = _object(value)
    if not record or not set(record) <= set(SPANS):
        return False
    spans = [span for entry in record.values() for span in (cast("list[object]", entry) if _is_list(entry) else [None])]
    return all(map(_is_span, spans)) and all(map(_is_row, record.get("rows", ())))


def _is_list(value: object) -> bool:
    return isinstance(value, list)


def _is_span(value: object) -> bool:
    span = _object(value)
    return _is_number(span.get("start")) and _is_number(span.get("end"))


def _is_row(value: object) -> bool:
    row = _object(value)
    return isinstance(row.get("prompt"), str) and isinstance(row.get("rewritten", ""), str)


def _is_place(value: object) -> bool:
    place = _object(value)
    return bool(place) and all(map(_is_number, place.values()))


def _is_loop(value: object) -> bool:
    record = _object(value)
    return record.get("end") in ("open", "closed") and _is_place(record.get("cycle"))


def _object(value: object) -> Mapping[str, Any]:
    """Return a JSON object; an empty one for any other value."""
    return cast("dict[str, Any]", value) if isinstance(value, dict) else {}


ENTRIES: dict[str, tuple[Callable[[object], bool], str]] = {
    "prompt": (_is_text, "text"),
    "rewritten": (_is_text, "text"),
    "licence": (_is_text, "text"),
    "prompts": (_are_prompts, "a list of frames from 0 on, in order, with their prompts"),
    "timeline": (_is_timeline, "an object of rows, transitions and gaps with their times"),
    "placement": (_is_place, "an object of numbers"),
    "loop": (_is_loop, "an object with the end and the cycle of a loop"),
}
