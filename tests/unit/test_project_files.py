"""The files around the code: README, workflow, hooks, the version in one place."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
FORMS = [path for path in sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")) if path.stem != "config"]
PINNED = re.compile(r"uses: [\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+")
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [*ROOT.glob("*.md"), *ROOT.glob(".github/*.md"), *ROOT.glob("models/*/README.md"), *ROOT.glob("docs/**/*.md")]
HOOKS = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]


def steps(path: Path) -> list[dict[str, Any]]:
    jobs = yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"]
    return [step for job in jobs.values() for step in job["steps"]]


def test_the_programs_that_read_files_are_installed_in_ci_and_none_may_be_missing() -> None:
    commands = [step.get("run", "") for path in WORKFLOWS for step in steps(path)]
    assert "make clients" in commands
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (recipe,) = re.findall(r"^clients: .*\n((?:\t.*\n)+)", makefile, re.MULTILINE)
    assert "MAREY_REQUIRE_CLIENTS=1" in recipe
    for program in ("bpy==", "pufbx==", "usd-core==", "three@", "gltf-validator@", "three-vrm-animation@"):
        assert program in recipe


def test_the_readme_is_short_and_begins_with_licence_and_actions() -> None:
    lines = README.splitlines()
    assert len(lines) <= 120
    screen = "\n".join(lines[:25])
    for needed in ("MIT", "CC BY-NC 4.0", "not for commercial use", "Supported actions", "Not supported"):
        assert needed in screen
    assert {"make demo", "make test"} <= set(re.findall(r"^\$ (make \w+)", README, re.MULTILINE))


def test_the_readme_shows_two_small_pictures() -> None:
    pictures = re.findall(r"!\[[^\]]+\]\((docs/images/\w+\.png)\)", README)
    assert len(pictures) == 2
    assert all((ROOT / picture).stat().st_size < 200_000 for picture in pictures)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_calls_make_targets_and_pinned_actions(path: Path) -> None:
    uses = [line.strip(" -") for line in path.read_text(encoding="utf-8").splitlines() if "uses:" in line]
    assert uses
    assert all(PINNED.fullmatch(line) for line in uses), uses
    runs = [step["run"] for step in steps(path) if "run" in step]
    assert runs
    assert all(re.fullmatch(r"make [a-z-]+", run) for run in runs), runs
    assert {run.removeprefix("make ") for run in runs} <= TARGETS


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_may_only_read_and_ends_in_time(path: Path) -> None:
    workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert workflow["permissions"] == {"contents": "read"}
    assert all(job["timeout-minutes"] <= 60 for job in workflow["jobs"].values())


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.name)
def test_an_issue_form_has_what_the_platform_asks_for(path: Path) -> None:
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= set(form)
    assert all(field["attributes"]["label"] for field in form["body"])


def test_hooks_are_local_and_run_the_locked_tools() -> None:
    locked = set(re.findall(r"^([\w-]+)==", (ROOT / "requirements" / "dev.lock").read_text(), re.MULTILINE))
    assert [repo["repo"] for repo in HOOKS] == ["local"]
    tools = {re.search(r"\.venv/bin/([\w-]+)", hook["entry"])[1] for hook in HOOKS[0]["hooks"]}  # pyright: ignore[reportOptionalSubscript]
    assert {"import-linter" if tool == "lint-imports" else tool for tool in tools} <= locked


def test_the_version_is_written_in_one_place() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == version("marey")
    sources = [path for part in ("shared", "services", "workers") for path in (ROOT / part).rglob("*.py")]
    second = re.compile(rf"^(VERSION|__version__)\s*=\s*[\"']{re.escape(project['version'])}", re.MULTILINE)
    assert [path for path in sources if second.search(path.read_text(encoding="utf-8"))] == []
    assert f"## [{project['version']}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_index_of_decisions_names_every_record() -> None:
    folder = ROOT / "docs" / "decisions"
    listed = re.findall(r"^\| (\d+) \| \[.+\]\((\S+)\) \| \w+", (folder / "README.md").read_text(), re.MULTILINE)
    records = sorted(path.name for path in folder.glob("0*.md"))
    assert [name for _, name in listed] == records
    assert [int(number) for number, _ in listed] == [int(name[:4]) for name in records]


def test_files_that_pages_name_exist() -> None:
    named = re.compile(r"`((?:shared|workers|services|tests|deploy|models|docs|benchmarks)/[\w/.-]+\.[a-z]+)`")
    missing = {
        f"{page.relative_to(ROOT)}: {name}"
        for page in PAGES
        for name in named.findall(page.read_text(encoding="utf-8"))
        if not (ROOT / name).exists()
    }
    assert missing == set()
