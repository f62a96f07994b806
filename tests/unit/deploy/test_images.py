"""The Dockerfile and what it is given; digests."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.support.compose import DOCKERFILE, copied, instructions
from tests.support.marey import REPOSITORY

STAGES = ("server", "worker")
DIGEST = "sha256:" + "5" * 64


def test_the_build_context_is_what_is_copied_and_nothing_else() -> None:
    lines = [line for line in (REPOSITORY / ".dockerignore").read_text().splitlines() if not line.startswith("#")]
    assert lines[0] == "*"
    allowed = {line.removeprefix("!") for line in lines if line.startswith("!")}
    stages = ("server-build", "worker-build", *STAGES)
    assert allowed == {source.split("/")[0] for stage in stages for source in copied(stage)}
    assert lines[-1] == "**/__pycache__", "the last line that fits decides"
    assert all((REPOSITORY / name).exists() for name in allowed)


def test_the_images_hold_every_package_of_the_distribution() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())
    assert set(project["tool"]["hatch"]["build"]["dev-mode-dirs"]) <= set(copied("server-build"))


def test_torch_is_the_one_of_the_lock_and_the_makefile() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())
    (wanted,) = (name for name in project["project"]["optional-dependencies"]["worker"] if name.startswith("torch="))
    assert f" {wanted} " in dict(instructions("worker-build"))["RUN"]
    assert f"TORCH  := {wanted}\n" in (REPOSITORY / "Makefile").read_text()


@pytest.mark.parametrize("stage", STAGES)
def test_an_image_runs_as_an_ordinary_user_and_compiles_nothing(stage: str) -> None:
    steps = instructions(stage)
    assert [rest for verb, rest in steps if verb == "USER"] == ["10001:10001"]
    assert not re.search(r"\b(apt|apt-get|gcc|g\+\+|make|build-essential)\b", " ".join(rest for _, rest in steps))
    assert not [rest for verb, rest in steps if verb in {"ADD", "VOLUME", "EXPOSE"}]
    assert dict(steps)["ENTRYPOINT"] == '["marey"]'


def test_everything_that_python_installs_is_hashed_or_ours_or_torch_or_asked_for() -> None:
    installs = re.findall(
        r"pip install (.*?)(?= && |$)", " && ".join(r for v, r in instructions("worker-build") if v == "RUN")
    )
    loose = [words for words in installs if "--require-hashes" not in words]
    assert len(installs) == 5
    assert all(words.strip().endswith((" .", "torch==2.13.0", "--no-deps $PLUGINS")) for words in loose)
    assert ("ARG", "PLUGINS=") in instructions("server-build"), "nobody's, until one is named"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Files that `pin-images` reads and writes, with a registry's tool that knows one digest."""
    (tmp_path / "deploy" / "docker").mkdir(parents=True)
    for name in ("docker-compose.yml", "deploy/docker/Dockerfile", "deploy/pin-images"):
        shutil.copy(REPOSITORY / name, tmp_path / name)
    tool = tmp_path / "bin" / "crane"
    tool.parent.mkdir()
    tool.write_text(f'#!/bin/sh\necho "$2" >>"{tmp_path}/asked"\necho "${{DIGEST:-{DIGEST}}}"\n')
    tool.chmod(0o755)
    return tmp_path


def pin(checkout: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    path = f"{checkout / 'bin'}:{os.environ['PATH']}"
    command = [checkout / "deploy" / "pin-images", *arguments]
    environment = {**os.environ, "PATH": path, **environment}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_pinning_asks_for_every_tag_and_writes_its_digest_behind_it(checkout: Path) -> None:
    before = {name: (checkout / name).read_text() for name in ("docker-compose.yml", "deploy/docker/Dockerfile")}
    assert pin(checkout).returncode == 0
    asked = (checkout / "asked").read_text().split()
    assert [name.split(":")[0] for name in asked] == [
        "chrislusf/seaweedfs",
        "pgvector/pgvector",
        "valkey/valkey",
        "python",
    ]
    for name, text in before.items():
        assert (checkout / name).read_text() == re.sub("sha256:[0-9a-f]{64}", DIGEST, text)
    assert DOCKERFILE.stat().st_mode == (checkout / "deploy/docker/Dockerfile").stat().st_mode


def test_a_tag_without_a_digest_gets_one(checkout: Path) -> None:
    compose = checkout / "docker-compose.yml"
    pinned = compose.read_text()
    compose.write_text(re.sub("@sha256:[0-9a-f]{64}", "", pinned))
    assert pin(checkout).returncode == 0
    assert compose.read_text() == re.sub("sha256:[0-9a-f]{64}", DIGEST, pinned)


def test_checking_changes_nothing_and_says_what_has_moved(checkout: Path) -> None:
    before = (checkout / "docker-compose.yml").read_text()
    found = pin(checkout, "--check")
    assert found.returncode == 1
    assert f"is now {DIGEST}" in found.stdout
    assert (checkout / "docker-compose.yml").read_text() == before
    pin(checkout)
    assert pin(checkout, "--check").returncode == 0


def test_an_answer_that_is_no_digest_is_refused(checkout: Path) -> None:
    before = (checkout / "docker-compose.yml").read_text()
    found = pin(checkout, DIGEST="unauthorized")
    assert found.returncode == 1
    assert "no digest of" in found.stderr
    assert (checkout / "docker-compose.yml").read_text() == before
