"""The report as one HTML file: tables, plots and small 3D players, readable without a network.

Style, scripts and motions are included. The content security policy lists the page's own scripts and style by their
hashes and lets it fetch nothing; every text is escaped, prompts included.
"""

from __future__ import annotations

import itertools

from markupsafe import Markup

from marey.evaluator.report.model import Report
from marey.evaluator.report.templates import PACKAGE, render
from marey.motion.clip import MotionClip
from marey.viz.pages import asset, script_json, whole_page
from marey.viz.paper import one_line
from marey.viz.player import motion_document


def to_html(report: Report) -> bytes:
    """Render the page. Equal reports give equal bytes.

    It includes three.js only if an exhibit has its clip: 0.6 MB then, and 0.05 MB for each clip of 10 s.
    """
    numbers = itertools.count()
    body = render("report.html.jinja", report=report, scripts=_scripts(report), next_clip=lambda: next(numbers))
    styles = (asset("small_players.css"), asset("report.css", PACKAGE))
    return whole_page(body, title=one_line(f"{report.title} · Marey"), styles=styles).encode()


def _scripts(report: Report) -> Markup:
    """Return every script of the page: the product's own code, and the motions as JSON that cannot end its element."""
    code = f"<script>\n{asset('report.js', PACKAGE)}</script>"
    if clips := _clips_of(report):
        motion = script_json(motion_document(clips, [""] * len(clips)))
        code += f'<script type="application/json" id="motion">{motion}</script>'
        code += f"<!--\n{asset('three.LICENSE.txt')}\n--><script>{asset('three.min.js')}</script>"
        names = ("scene.js", "clip.js", "small_players.js")
        code += "".join(f"<script>\n{asset(name)}</script>" for name in names)
    return Markup(code)  # noqa: S704


def _clips_of(report: Report) -> list[MotionClip]:
    """Return the motions of the page, in the order of its players."""
    return [exhibit.clip for exhibit in (*report.worst, *report.best) if exhibit.clip is not None]
