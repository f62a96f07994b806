"""Player: one HTML file that shows motion in 3D, without a network.

The page is self-contained: style, script, three.js and the motion (root as float32, local rotations as float16, which
keeps joints within a millimetre of the clip's; the page runs the forward kinematics). A content security policy forbids
the page to fetch anything. Every text is escaped, prompts included.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.files import write_atomically
from marey.viz.body import dress_clip
from marey.viz.pages import asset, body_document, fill, script_json, whole_page
from marey.viz.paper import one_line
from marey.viz.render import caption_of, facts_of

THEMES = ("auto", "light", "dark")


def html_player(
    clips: MotionClip | Sequence[MotionClip],
    path: str | Path,
    *,
    title: str | None = None,
    captions: Sequence[str] | None = None,
    theme: str = "auto",
) -> Path:
    """Write a page that plays clips in 3D.

    Args:
        clips: one clip or several, which become a list to choose from.
        path: the `.html` to write.
        title: of the page; otherwise the first caption.
        captions: one per clip; otherwise the prompt of its manifest.
        theme: `auto` (as the browser asks), `light` or `dark`.

    Returns:
        The path written.

    Raises:
        InvalidInput: no clip, an unknown theme, or a path that is not a writable HTML file.
    """
    rows = [clips] if isinstance(clips, MotionClip) else list(clips)
    path = Path(path)
    if not rows:
        raise InvalidInput("no clip to play", hint="Give at least one.")
    if path.suffix.lower() not in (".html", ".htm"):
        raise InvalidInput(f"a player is an .html, not {path.suffix or 'a name without ending'}", where=str(path))
    if captions is not None and len(captions) != len(rows):
        raise InvalidInput(f"{len(captions)} captions for {len(rows)} clips")
    if theme not in THEMES:
        raise InvalidInput(f"unknown theme {theme!r}", hint=f"One of: {', '.join(THEMES)}.")
    texts = [one_line(c) for c in captions] if captions else [one_line(caption_of(c)) for c in rows]
    page = _page(motion_document(rows, texts), one_line(title or texts[0]) or "Marey", theme)
    write_atomically(path, page.encode())
    return path


def _page(document: dict[str, object], title: str, theme: str) -> str:
    parts = {
        "%MOTION%": script_json(document),
        "%LICENCE%": asset("three.LICENSE.txt"),
        "%THREE%": asset("three.min.js"),
        "%SCENE%": asset("scene.js"),
        "%CLIP%": asset("clip.js"),
        "%PLAYER%": asset("player.js"),
    }
    body = fill(asset("player.html"), parts)
    return whole_page(body, title=title, styles=[asset("player.css")], theme=theme)


def motion_document(clips: Sequence[MotionClip], captions: Sequence[str]) -> dict[str, object]:
    """Return clips with a caption each, as clip.js reads them from a page: `bodies`, and `clips` that refer to them."""
    bodies: dict[str, int] = {}  # clips of one skeleton share one body
    entries: list[dict[str, object]] = []
    for number, (clip, caption) in enumerate(zip(clips, captions, strict=True), start=1):
        body = json.dumps(body_document(clip.skeleton, dress_clip(clip)), separators=(",", ":"), allow_nan=False)
        entries.append(
            {
                "name": f"clip {number}",
                "caption": caption,
                "facts": one_line(facts_of(clip)),
                "body": bodies.setdefault(body, len(bodies)),
                "fps": float(clip.fps),
                "frames": clip.frames,
                "root": _base64(np.asarray(clip.root, "<f4")),
                "rotations": _base64(np.asarray(clip.rotations, "<f2")),
                "contacts": _base64(np.asarray(clip.contacts, np.uint8)),
            }
        )
    return {"bodies": [json.loads(body) for body in bodies], "clips": entries}


def _base64(array: NDArray[np.generic]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
