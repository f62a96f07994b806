"""The report of an evaluation: one HTML page, the same as JSON and as Markdown."""

from marey.evaluator.report.document import from_json, to_json
from marey.evaluator.report.markdown import to_markdown
from marey.evaluator.report.model import Baseline, Change, Report
from marey.evaluator.report.page import to_html
from marey.evaluator.report.parts import (
    ArtifactReference,
    Exhibit,
    GenerationSpeed,
    HeatCell,
    Metric,
    MetricRow,
    Repeats,
    TrendPoint,
    Value,
)
from marey.evaluator.report.shots import (
    ConstraintKind,
    ConstraintSection,
    TimelineSection,
    WorstConstraint,
    WorstRow,
)
from marey.evaluator.report.words import headline, sentence_of
from marey.measures.scores import MotionScore

__all__ = [
    "ArtifactReference",
    "Baseline",
    "Change",
    "ConstraintKind",
    "ConstraintSection",
    "Exhibit",
    "GenerationSpeed",
    "HeatCell",
    "Metric",
    "MetricRow",
    "MotionScore",
    "Repeats",
    "Report",
    "TimelineSection",
    "TrendPoint",
    "Value",
    "WorstConstraint",
    "WorstRow",
    "from_json",
    "headline",
    "sentence_of",
    "to_html",
    "to_json",
    "to_markdown",
]
