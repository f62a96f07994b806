"""Assemble pages with a 3D figure: one HTML file with style, scripts, three.js and data inside.

Nothing is loaded from elsewhere. Inserted values are data: no text can end its element or be read as a mark of the
template.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib import resources

from marey.core.characters import escape
from marey.motion.skeleton import Skeleton
from marey.viz.body import BodyShape

_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)
_POLICY = '\n<meta http-equiv="Content-Security-Policy" content="{policy}">'
_STYLE = re.compile(r"<style>(.*?)</style>", re.DOTALL)


def asset(name: str, package: str = "marey.viz") -> str:
    """Return the text of a file in a package's `assets`."""
    return (resources.files(package) / "assets" / name).read_text(encoding="utf-8")


def fill(template: str, parts: Mapping[str, str]) -> str:
    """Replace each mark of a template by its text, in order and once each.

    Inserted text is never searched for the next mark.
    """
    pieces: list[str] = []
    for mark, text in parts.items():
        before, template = template.split(mark, 1)
        pieces += [before, text]
    return "".join([*pieces, template])


def whole_page(body: str, *, title: str, styles: Sequence[str], theme: str = "auto", sealed: bool = True) -> str:
    """Wrap a body in the shared page head.

    Args:
        body: its `<body>` element, with scripts.
        title: one line of plain text.
        styles: its own, behind the one that all share.
        theme: `auto` (as the browser asks), `light` or `dark`.
        sealed: by a content security policy of its own, it runs its own scripts and styles and fetches nothing.
            Otherwise the server sends one.
    """
    page = fill(
        asset("page.html"),
        {
            "%THEME%": theme,
            "%TITLE%": html.escape(escape(title, lines=False)),
            "%STYLE%": "".join([asset("page.css"), *styles]),
            "%BODY%": body,
        },
    )
    # Last, for it holds hashes of the rest.
    return fill(page, {"%POLICY%": _POLICY.format(policy=_policy(page)) if sealed else ""})


def script_json(value: object) -> str:
    """Return JSON that may be inserted in a `<script>`: no character in it can end the element or start a comment."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def code_hashes(page: str) -> tuple[str, str]:
    """Return `script-src` and `style-src` of a policy that allows only the page's own scripts and styles."""
    return (
        " ".join(["script-src", *(_hash(script) for script in _SCRIPT.findall(page))]),
        " ".join(["style-src", *(_hash(text) for text in _STYLE.findall(page))]),
    )


def _policy(page: str) -> str:
    return "; ".join(
        ("default-src 'none'", *code_hashes(page), "img-src data:", "base-uri 'none'", "form-action 'none'")
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def body_document(skeleton: Skeleton, body: BodyShape) -> dict[str, object]:
    """Return a skeleton and its body in the form that scene.js reads."""
    return {
        "parents": list(skeleton.parents),
        "offsets": [[round(float(x), 6) for x in offset] for offset in skeleton.offsets],
        "feet": list(skeleton.feet),
        "height": round(body.height, 4),
        "sole": round(body.sole, 4),
        "limbs": [
            {
                "part": limb.part,
                "joints": [limb.start, limb.end],
                "radii": [round(limb.start_radius, 5), round(limb.end_radius, 5)],
                "offsets": [[round(x, 5) for x in offset] for offset in (limb.start_offset, limb.end_offset)],
            }
            for limb in body.limbs
        ],
    }
