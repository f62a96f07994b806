"""HTML by construction: whatever is not markup already is escaped when it becomes part of an element."""

from __future__ import annotations

import html
import unicodedata


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def text(value: str) -> Markup:
    """Any text as data; control characters (line breaks, turns of the writing direction) become spaces."""
    if isinstance(value, Markup):
        return value
    return Markup(html.escape("".join(" " if unicodedata.category(c).startswith("C") else c for c in value)))


def element(name: str, *children: str, **attributes: str | int | None) -> Markup:
    """An element; `class_` gives `class`, `aria_label` gives `aria-label`, None leaves an attribute out."""
    given = [(key.rstrip("_").replace("_", "-"), value) for key, value in attributes.items() if value is not None]
    start = "".join([f"<{name}", *(f' {key}="{text(str(value))}"' for key, value in given), ">"])
    return Markup(f"{start}{join(*children)}</{name}>")


def void(name: str, **attributes: str | int | None) -> Markup:
    """An element that never has an end: `input`, `br`."""
    return Markup(element(name, **attributes).removesuffix(f"</{name}>"))


def join(*children: str) -> Markup:
    """One after the other, each escaped unless it is markup."""
    return Markup("".join(text(child) for child in children))
