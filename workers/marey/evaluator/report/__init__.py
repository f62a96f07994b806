"""The report of an evaluation: one HTML page, the same as JSON and as Markdown."""

from shared.measures.scores import MotionScore
from workers.evaluator.report.document import from_json, to_json
from workers.evaluator.report.markdown import to_markdown
from workers.evaluator.report.model import Baseline, Change, Report
from workers.evaluator.report.page import to_html
from workers.evaluator.report.parts import (
    Exhibit,
    HeatCell,
    Metric,
    Reference,
    Repeats,
    Row,
    Speed,
    TrendPoint,
    Value,
)
from workers.evaluator.report.words import headline, sentence_of

__all__ = [
    "Baseline",
    "Change",
    "Exhibit",
    "HeatCell",
    "Metric",
    "MotionScore",
    "Reference",
    "Repeats",
    "Report",
    "Row",
    "Speed",
    "TrendPoint",
    "Value",
    "from_json",
    "headline",
    "sentence_of",
    "to_html",
    "to_json",
    "to_markdown",
]
