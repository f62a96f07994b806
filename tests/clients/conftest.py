"""Under `MAREY_REQUIRE_CLIENTS=1` a skipped test of this folder fails: every program has to be there.

Tests marked `data` may skip: the capture archives are not installed by `make clients`.
"""

from __future__ import annotations

import os
from collections.abc import Generator

import pytest


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    required = os.environ.get("MAREY_REQUIRE_CLIENTS") == "1" and item.get_closest_marker("data") is None
    if report.skipped and required and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped, and MAREY_REQUIRE_CLIENTS=1: {report.longrepr}"
    return report
