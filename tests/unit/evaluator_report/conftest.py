"""A whole report, with clips of a drawn walker."""

from __future__ import annotations

import pytest

from marey.evaluator.report import Report
from tests.support.reports import sample_report
from tests.support.walker import walker


@pytest.fixture(scope="session")
def report() -> Report:
    """The sample: regressed, with missing values, an FID of too few motions, a trend, a heat map, four clips."""
    return sample_report(
        worst=[walker(prompt="a person kicks"), walker(turn=0.7, prompt="a person turns")],
        best=[walker(prompt="a person walks"), walker(turn=-0.4, prompt="a person strolls")],
    )
