"""Gallery: one HTML file with many motions as small 3D players, for deciding which to keep.

The page is self-contained as the player is: every text is escaped, and it may fetch nothing. It changes nothing by
itself: it shows the commands that do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.files import write_atomically
from marey.viz.pages import asset, fill, script_json, whole_page
from marey.viz.paper import one_line
from marey.viz.player import motion_document

MOST_CARDS = 400
"""Motions of a page: a clip of 10 s takes 50 kB."""


@dataclass(frozen=True)
class EditNote:
    """How an edited motion came about.

    Args:
        source: id of the motion that was edited; its card is linked where the page has it.
        prompt: of the source; empty = not known.
        operations: in one line.
    """

    source: str
    prompt: str
    operations: str


@dataclass(frozen=True)
class Card:
    """A motion with its description.

    Args:
        id: reference for the commands.
        facts: one line: number, name, seed, length.
        said: earlier review; empty = none.
        flags: what is wrong with it, by `marey.quality`.
        edit: of an edited motion.
    """

    id: str
    clip: MotionClip
    prompt: str
    facts: str
    tags: Sequence[str] = ()
    said: str = ""
    flags: Sequence[str] = ()
    edit: EditNote | None = None

    def document(self) -> dict[str, Any]:
        """Return what the page shows of the motion."""
        edit = self.edit
        note = None if edit is None else {name: one_line(text) for name, text in vars(edit).items()}
        return {
            "id": self.id,
            "prompt": one_line(self.prompt),
            "facts": one_line(self.facts),
            "tags": [one_line(tag) for tag in self.tags],
            "said": one_line(self.said),
            "flags": [one_line(flag) for flag in self.flags],
            "edit": note,
        }


def html_gallery(
    cards: Sequence[Card],
    path: str | Path,
    *,
    title: str,
    count: str = "",
    earlier: str | None = None,
    later: str | None = None,
    columns: int = 1,
) -> Path:
    """Write a page of motions.

    Args:
        path: the `.html` to write.
        count: number of this page and of all pages.
        earlier, later: names of the pages beside it.
        columns: motions that belong side by side; 1 = as many as the window has room for.

    Returns:
        The path written.

    Raises:
        InvalidInput: no motion, more than `MOST_CARDS`, or a path that is not a writable HTML file.
    """
    path = Path(path)
    if not 1 <= len(cards) <= MOST_CARDS:
        raise InvalidInput(f"{len(cards)} motions; a page takes 1 to {MOST_CARDS}")
    if path.suffix.lower() not in (".html", ".htm"):
        raise InvalidInput(f"a gallery is an .html, not {path.suffix or 'a name without ending'}", where=str(path))
    document = {
        "title": one_line(title),
        "count": count,
        "columns": columns,
        "earlier": None if earlier is None else f"./{quote(earlier)}",
        "later": None if later is None else f"./{quote(later)}",
        "cards": [card.document() for card in cards],
    }
    body = fill(
        asset("gallery.html"),
        {
            "%CARDS%": script_json(document),
            "%MOTION%": script_json(motion_document([card.clip for card in cards], [""] * len(cards))),
            "%LICENCE%": asset("three.LICENSE.txt"),
            "%THREE%": asset("three.min.js"),
            "%SCENE%": asset("scene.js"),
            "%CLIP%": asset("clip.js"),
            "%GALLERY%": asset("gallery.js"),
            "%PLAYERS%": asset("small_players.js"),
        },
    )
    styles = (asset("small_players.css"), asset("gallery.css"))
    write_atomically(path, whole_page(body, title=f"{one_line(title)} · Marey", styles=styles).encode())
    return path
