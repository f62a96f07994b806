"""The live page: type a prompt, watch a figure move while its motion is generated, steer it.

One file that loads nothing: the page of `GET /live`, with its permissions. Its scripts and its style are listed by
their hashes, so no other code runs, whatever data the page receives; it connects to its own server alone.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from functools import lru_cache

from marey.motion.skeleton import HUMANML3D
from marey.viz.body import dress
from marey.viz.pages import asset, body_document, code_hashes, fill, script_json, whole_page

SKELETONS = (HUMANML3D,)
"""Skeletons of live streams; others are drawn as thin bones. The first is shown while there is no stream."""
_HOST = re.compile(r"[A-Za-z0-9.-]+(:[0-9]{1,5})?")


@dataclass(frozen=True)
class LivePage:
    """The page and its permissions.

    Attributes:
        content: HTML, UTF-8.
        etag: changes when the content does.
        hashes: `script-src` and `style-src` of its content security policy.
    """

    content: bytes
    etag: str
    hashes: tuple[str, str]

    def policy(self, host: str = "") -> str:
        """The content security policy of the page.

        Args:
            host: the request's `Host`. Some browsers do not count sockets of the page's own host as `'self'`.
        """
        own = f" ws://{host} wss://{host}" if _HOST.fullmatch(host) else ""
        return "; ".join(
            (
                "default-src 'none'",
                *self.hashes,
                f"connect-src 'self'{own}",
                "img-src data:",
                "base-uri 'none'",
                "form-action 'none'",
                "frame-ancestors 'none'",
            )
        )


@lru_cache(maxsize=4)
def live_page(examples: tuple[str, ...] = ()) -> LivePage:
    """Return the page, assembled once per process.

    Args:
        examples: example prompts.
    """
    parts = {
        "%EXAMPLES%": script_json(examples),
        "%BODIES%": script_json([{"names": s.joint_names, **body_document(s, dress(s))} for s in SKELETONS]),
        "%LICENCE%": asset("three.LICENSE.txt"),
        "%THREE%": asset("three.min.js"),
        "%SCENE%": asset("scene.js"),
        "%FRAMES%": asset("live_frames.js"),
        "%LINK%": asset("live_link.js"),
        "%VIEW%": asset("live_view.js"),
        "%LIVE%": asset("live.js"),
    }
    body = fill(asset("live.html"), parts)
    page = whole_page(body, title="Marey live", styles=[asset("live.css")], sealed=False)
    content = page.encode()
    return LivePage(content, f'"{hashlib.sha256(content).hexdigest()[:32]}"', code_hashes(page))
