"""`GET /`: an overview page for people who open the address of the API."""

from __future__ import annotations

from functools import cache

from fastapi import APIRouter, Response

from marey.viz.pages import code_hashes, whole_page

router = APIRouter()

STYLE = "main { max-width: 40em; margin: 12vh auto 0; padding: 0 24px; } a { color: var(--accent); }"
BODY = """<body>
<main>
<h1>Marey</h1>
<p>Text in, 3D human motion out.</p>
<ul>
<li><a href="live">/live</a>: type a prompt, watch the motion while it is made.</li>
<li><a href="docs">/docs</a>: the API, to read and to try.</li>
<li><a href="openapi.json">/openapi.json</a>: every route of the API, as OpenAPI 3.1.</li>
<li><a href="readyz">/readyz</a>: whether all that the server needs is there.</li>
</ul>
<p>The API and <code>/live</code> want a key: <code>marey admin keys create NAME</code> makes one
on the server's machine. A request sends it as <code>Authorization: Bearer KEY</code>.</p>
</main>
</body>
"""


@cache
def home_page() -> tuple[str, dict[str, str]]:
    """Return the page and its headers."""
    page = whole_page(BODY, title="Marey", styles=[STYLE], sealed=False)
    rules = ("default-src 'none'", *code_hashes(page), "img-src data:", "base-uri 'none'", "frame-ancestors 'none'")
    return page, {
        "Cache-Control": "no-cache",
        "Content-Security-Policy": "; ".join(rules),
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
    }


@router.get("/", include_in_schema=False)
def home() -> Response:
    """The overview page; it holds no data of a tenant."""
    page, headers = home_page()
    return Response(page, headers=headers, media_type="text/html")
