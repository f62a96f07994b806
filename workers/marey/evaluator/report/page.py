"""The report as one HTML file: tables, plots and small 3D players, for a person and without a network.

Style, scripts and motions are inside. The content security policy names the page's own scripts and style by their
hashes and lets it fetch nothing; every text is escaped: a prompt is data, whatever is in it.
"""

from __future__ import annotations

from marey.evaluator.report.exhibits import clips_of, exhibits
from marey.evaluator.report.markup import Markup, element, join
from marey.evaluator.report.model import Report
from marey.evaluator.report.sections import heat, numbers, repeat, speed, top, verdict
from marey.evaluator.report.trends import trends
from marey.viz.pages import asset, fill, script_json, whole_page
from marey.viz.paper import one_line
from marey.viz.player import motion_document

PACKAGE = "marey.evaluator.report"


def to_html(report: Report) -> bytes:
    """The page. Equal reports give equal bytes.

    It holds three.js only when an exhibit has its clip: 0.6 MB then, and 0.05 MB for each clip of 10 s.
    """
    parts = (top(report), verdict(report), numbers(report), heat(report))
    main = join(*parts, exhibits(report), trends(report), speed(report), repeat(report))
    body = fill(asset("report.html", PACKAGE), {"%REPORT%": main, "%SCRIPTS%": _scripts(report)})
    styles = (asset("small_players.css"), asset("report.css", PACKAGE))
    return whole_page(body, title=one_line(f"{report.title} · Marey"), styles=styles).encode()


def _scripts(report: Report) -> Markup:
    theme = Markup(f"<script>\n{asset('report.js', PACKAGE)}</script>")
    clips = clips_of(report)
    if not clips:
        return theme
    document = motion_document(clips, [""] * len(clips))
    code = [f"<script>{asset('three.min.js')}</script>"]
    code += [f"<script>\n{asset(name)}</script>" for name in ("scene.js", "clip.js", "small_players.js")]
    motion = element("script", Markup(script_json(document)), type="application/json", id="motion")
    licence = Markup(f"<!--\n{asset('three.LICENSE.txt')}\n-->")
    return join(theme, motion, licence, *(Markup(each) for each in code))
