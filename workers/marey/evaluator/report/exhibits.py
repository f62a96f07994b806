"""The worst and the best clips: what was asked, what the check said, and the motion itself to look at."""

from __future__ import annotations

import itertools

from marey.evaluator.report.markup import Markup, element, join, void
from marey.evaluator.report.model import Report
from marey.evaluator.report.parts import Exhibit
from marey.evaluator.report.sections import section
from marey.motion.clip import MotionClip


def exhibits(report: Report) -> Markup:
    """Both sections, the worst first: Monday's work is there."""
    ranked = element("p", f"Ranked by {report.ranked_by}.", class_="remark") if report.ranked_by else ""
    numbers = itertools.count()
    cards = [_card(e, next(numbers) if e.clip is not None else None) for e in (*report.worst, *report.best)]
    worst, best = cards[: len(report.worst)], cards[len(report.worst) :]
    return join(
        *(
            section(title, ranked, element("div", *shown, class_="clips"), id=name)
            for title, name, shown in (("Worst clips", "worst", worst), ("Best clips", "best", best))
            if shown
        )
    )


def clips_of(report: Report) -> list[MotionClip]:
    """The motions that the page holds, in the order of its players."""
    return [exhibit.clip for exhibit in (*report.worst, *report.best) if exhibit.clip is not None]


def _card(exhibit: Exhibit, clip: int | None) -> Markup:
    passed = "passed" if exhibit.passed else "failed"
    sign = element("span", "✓" if exhibit.passed else "✕", aria_hidden="true")
    reason = f": {exhibit.reason}" if exhibit.reason else ""
    facts = f"seed {exhibit.seed} · score {score_of(exhibit)}"
    player = _player(clip, exhibit.prompt) if clip is not None else ""
    told = element(
        "figcaption",
        element("p", exhibit.prompt, class_="prompt"),
        element("p", sign, " ", element("b", passed), reason, class_=passed),
        element("p", facts, class_="remark"),
    )
    return element("figure", player, told, class_="clip")


def score_of(exhibit: Exhibit) -> str:
    """Three digits tell clips apart."""
    return f"{exhibit.score:.3f}".replace("-", "\u2212")


def _player(clip: int, prompt: str) -> Markup:
    canvas = element("canvas", aria_label=f"3D view of “{prompt}”: drag to turn", role="img", width=340, height=255)
    tools = element(
        "div",
        element("button", class_="play", type="button", aria_label="Play"),
        void("input", class_="scrub", type="range", min=0, max=1, value=0, step="any", aria_label="Time"),
        element("output", "", class_="clock"),
        element("button", "larger", class_="larger", type="button", aria_pressed="false"),
        class_="tools",
    )
    return element("div", canvas, tools, class_="player", data_clip=clip)
