"""The templates of the report: Jinja2, every text escaped, a missing name is an error."""

from __future__ import annotations

import unicodedata
from functools import cache
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from marey.evaluator.report import shots, tables, trends, words
from marey.viz.pages import asset

PACKAGE = "marey.evaluator.report"


def render(name: str, **context: Any) -> Markup:
    """Render a template of `assets`. Text in the context is data, unless it is Markup already."""
    return Markup(_environment().get_template(name).render(context))  # noqa: S704


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FunctionLoader(lambda name: asset(name, PACKAGE)),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_without_controls,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {name: vars(module)[name] for module, names in _NAMES.items() for name in names}
    return environment


_NAMES = {
    shots: ("shots_of",),
    tables: ("MOST_STYLES", "heat_of", "heat_step", "in_percent", "tables_of", "trended", "weakest_of"),
    trends: ("BOTTOM", "HEIGHT", "HIT", "LEFT", "RIGHT", "TOP", "WIDTH", "plot_of"),
    words: (
        *("CHANGES", "LEGEND", "day", "direction", "headline", "intervals_of", "moment", "number", "plain"),
        *("score_of", "speed_of"),
    ),
}


def _without_controls(value: Any) -> Any:
    """Replace control characters of a text (line breaks, direction overrides) by spaces."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return "".join(" " if unicodedata.category(character).startswith("C") else character for character in value)
