"""Ablations judged on two prompts."""

from __future__ import annotations

import pytest

from marey.checks.prompts import evaluation_prompts
from marey.training import ablation


def judge_by_two_prompts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let ablations judge their variants by the first two of the evaluation prompts."""
    two = evaluation_prompts()[:2]
    monkeypatch.setattr(ablation, "evaluation_prompts", lambda: two)
