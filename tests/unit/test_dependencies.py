"""Dependencies of each extra, and the page that lists them."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, distribution

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from requirements.dependencies import NOT_INSTALLED, locked, page
from tests.support.marey import REPOSITORY

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
UNUSED = {"sentence-transformers", "onnxruntime", "scikit-learn"}


def closure(extra: str) -> set[str]:
    """Packages that an extra brings when it is resolved without the lock, by what the installed ones ask for."""
    found: set[tuple[str, str]] = set()
    todo = [Requirement(f"{PROJECT['name']}[{extra}]")]
    while todo:
        requirement = todo.pop()
        name = canonicalize_name(requirement.name)
        for wanted in ("", *sorted(requirement.extras)):
            if (name, wanted) not in found:
                found.add((name, wanted))
                todo += [each for each in asked_by(name) if holds(each, wanted)]
    return {name for name, _ in found} - {PROJECT["name"]}


def asked_by(name: str) -> list[Requirement]:
    if name == PROJECT["name"]:  # as it stands now, not as it was when this environment was made
        optional = PROJECT["optional-dependencies"].items()
        marked = [f'{text}; extra == "{extra}"' for extra, texts in optional for text in texts]
        return [Requirement(text) for text in [*PROJECT["dependencies"], *marked]]
    try:
        return [Requirement(text) for text in distribution(name).requires or []]
    except PackageNotFoundError:
        return []


def holds(requirement: Requirement, extra: str) -> bool:
    """Return True if the marker holds for Python 3.11.0, which the locks are for as well."""
    return requirement.marker is None or requirement.marker.evaluate({"extra": extra, "python_full_version": "3.11.0"})


def test_a_worker_without_the_lock_brings_nothing_that_is_not_imported() -> None:
    worker = closure("worker")
    assert worker > {"torch", "transformers", "tokenizers", "fastapi", "numpy"}
    assert not worker & (UNUSED | {"tensorboard"})
    assert "tensorboard" in closure("train")


def test_the_server_s_lock_holds_what_the_server_needs_and_nothing_of_torch() -> None:
    server = closure("server")
    assert set(locked("server")) == {canonicalize_name(name) for name in server} & set(locked("dev"))
    assert not set(locked("server")) & {"torch", "sympy", "networkx", "mpmath", "filelock", "fsspec"}


@pytest.mark.parametrize("lock", ["worker", "dev"])
def test_locks_bring_nothing_that_is_not_imported(lock: str) -> None:
    assert not set(locked(lock)) & UNUSED


def test_workers_run_without_the_packages_of_training() -> None:
    blocked = ("tensorboard", "onnxruntime", "sentence_transformers", "sklearn")
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({blocked}))\n"
        "import marey.evaluator.handler, marey.text_service.handler, marey.runtime.worker\n"
        "from marey.registry import get_model, model_names, resolve\n"
        "for spec in map(get_model, model_names()):\n"
        "    for reference in filter(None, (spec.handler, spec.load, spec.live)):\n"
        "        resolve(reference)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_page_of_dependencies_is_that_of_the_locks() -> None:
    """Written anew by `make lock`, or `python -m requirements.dependencies docs/reference/dependencies.md`."""
    made = page().splitlines()
    kept = (REPOSITORY / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(made):
        if NOT_INSTALLED in line:  # another platform leaves some out
            pattern = re.escape(line).replace(re.escape(NOT_INSTALLED), ".*")
            made[number] = next((each for each in kept if re.fullmatch(pattern, each)), line)
    assert made == kept


def test_the_page_names_every_library_of_javascript_in_the_repository() -> None:
    tail = page().partition("## Not Python packages")[2]
    foreign = [path for path in REPOSITORY.glob("s*/**/assets/*.js") if path.with_name("README.md").exists()]
    foreign = [path for path in foreign if path.stat().st_size > 100_000]
    assert {path.name for path in foreign} == {"three.min.js", "swagger-ui-bundle.js"}
    for path in foreign:
        assert f"`{path.relative_to(REPOSITORY).as_posix()}`" in tail
