"""A pytest plugin that records which lines each test runs, and how long each test and each shared fixture takes.

Writes `<process>.json` (durations) and `.coverage.<process>` (lines by context) into the folder that
`MAREY_MUTANTS_PART` names. A context is the id of a test, or the key of a fixture wider than one test, whose lines
count for every test that uses it.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import coverage
import pytest

SOURCES = ("shared/marey", "workers/marey", "services/marey")


class Recorder:
    """Hooks of a recording run."""

    def __init__(self, folder: Path, root: Path) -> None:
        name = os.environ.get("PYTEST_XDIST_WORKER", "main")
        self.durations = folder / f"{name}.json"
        self.root = root
        self.tests: dict[str, dict[str, Any]] = {}
        self.fixtures: dict[str, float] = {}
        self._contexts: list[str] = []
        self._set_up = 0.0
        sources = [str(root / source) for source in SOURCES]
        self.coverage = coverage.Coverage(data_file=folder / f".coverage.{name}", source=sources, config_file=False)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        """Trace from before the first import of the product."""
        self.coverage.start()

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self) -> None:
        """Write what was recorded."""
        self.coverage.stop()
        self.coverage.save()
        self.durations.write_text(json.dumps({"tests": self.tests, "fixtures": self.fixtures}))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[Any]:
        """Count the lines and the seconds of a test, less those of the fixtures that it shares."""
        wide = _wide_fixtures(item)
        self._enter(item.nodeid)
        self._set_up = 0.0
        started = time.monotonic()
        try:
            return (yield)
        finally:
            seconds = time.monotonic() - started - self._set_up
            self._leave()
            record = self.tests.setdefault(item.nodeid, {})
            record |= {"file": _file(item, self.root), "seconds": round(seconds, 4), "fixtures": wide}

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[Any]:
        """Count what a fixture wider than one test does for itself."""
        if fixturedef.scope == "function":
            return (yield)
        key = _key(fixturedef)
        self._enter(key)
        started = time.monotonic()
        try:
            return (yield)
        finally:
            seconds = time.monotonic() - started
            self._leave()
            self.fixtures[key] = round(max(seconds, self.fixtures.get(key, 0.0)), 4)
            self._set_up += seconds

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note which tests passed."""
        if report.when == "call":
            self.tests.setdefault(report.nodeid, {})["passed"] = report.passed and not hasattr(report, "wasxfail")

    def _enter(self, context: str) -> None:
        self._contexts.append(context)
        self.coverage.switch_context(context)

    def _leave(self) -> None:
        self._contexts.pop()
        self.coverage.switch_context(self._contexts[-1] if self._contexts else "")


def pytest_configure(config: pytest.Config) -> None:
    """Record in the processes that run tests, and not in the one that hands them out."""
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        config.pluginmanager.register(Recorder(Path(os.environ["MAREY_MUTANTS_PART"]), config.rootpath))


def _wide_fixtures(item: pytest.Item) -> list[str]:
    definitions = getattr(item, "_fixtureinfo").name2fixturedefs.values()  # noqa: B009
    return sorted({_key(each) for several in definitions for each in several[-1:] if each.scope != "function"})


def _key(fixturedef: Any) -> str:
    return f"fixture {fixturedef.baseid}:{fixturedef.argname}"


def _file(item: pytest.Item, root: Path) -> str:
    return item.path.relative_to(root).as_posix()
