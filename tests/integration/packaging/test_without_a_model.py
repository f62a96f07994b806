"""A checkout without a model: its lint passes, and so do the unit tests of the platform.

No file but the model's own, the lines that register it and those of documents that name its files are taken out.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from marey.registry import model_names
from tests.support.models import OTHERS
from tests.support.without_model import copy_without

SECONDS = 1200.0
IMPORT_LINTER = "from importlinter.cli import lint_imports_command; lint_imports_command()"
LINT = (
    ("-m", "ruff", "check", "."),
    ("-m", "ruff", "format", "--check", "."),
    ("-c", IMPORT_LINTER),
    ("-m", "tests.lint.words"),
)
PLATFORM = (
    *("registry", "bundles", "exporters", "generating", "deploy", "vocabulary", "docs", "evaluations", "streams"),
    *("cli/test_import.py", "cli/test_models.py", "client/test_public.py"),
)
"""Unit tests of parts that know the models by the registry alone, beside those at the top of `tests/unit`."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=OTHERS)
def model(request: pytest.FixtureRequest) -> str:
    """A model that is not the default."""
    return request.param


@pytest.fixture(scope="module")
def tree(model: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The checkout without the model."""
    tree = tmp_path_factory.mktemp("without") / "tree"
    copy_without(model, tree)
    return tree


def run(tree: Path, *arguments: str) -> str:
    """Run the Python of the copy in the copy; returns its output."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "MAREY"))}
    environment["PYTHONPATH"] = ":".join(("shared", "workers", "services", "migrations"))
    python = str(tree / ".venv" / "bin" / "python")
    done = subprocess.run(
        [python, *arguments], cwd=tree, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False
    )
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-4000:]
    return done.stdout


def test_the_copy_does_not_know_the_model(model: str, tree: Path) -> None:
    others = [name for name in model_names() if name != model]
    assert len(others) < len(model_names())
    code = "from marey.registry import model_names; print(*model_names())"
    assert run(tree, "-c", code).split() == others


@pytest.mark.parametrize("command", LINT, ids=lambda command: command[1].split(" ")[-1])
def test_the_lint_passes(tree: Path, command: tuple[str, ...]) -> None:
    run(tree, *command)


def test_the_unit_tests_of_the_platform_pass(tree: Path) -> None:
    top = [path.relative_to(tree).as_posix() for path in sorted((tree / "tests" / "unit").glob("test_*.py"))]
    output = run(tree, "-m", "pytest", "-q", "-n", "0", *top, *(f"tests/unit/{name}" for name in PLATFORM))
    assert " passed" in output
