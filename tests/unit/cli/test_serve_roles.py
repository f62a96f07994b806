"""Which children `marey serve` starts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from marey.cli.main import app
from marey.cli.roles import serving
from marey.cli.roles.serving import MOST_WORKERS, WORKER_MEMORY, default_roles, default_workers, parse_roles
from marey.cli.supervisor import Supervisor
from marey.core.settings import Settings
from tests.support.evaluations import write_evaluator, write_generator


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[int, int], None]:
    """Make this machine one of so many cores and bytes, without a GPU."""
    sizes = {"SC_PAGE_SIZE": 4096}

    def become(cores: int, memory: int) -> None:
        sizes["SC_PHYS_PAGES"] = memory // 4096
        monkeypatch.setattr(serving, "cores", lambda: cores)

    monkeypatch.setattr(os, "sysconf", sizes.__getitem__)
    monkeypatch.setattr(serving, "NVIDIA", tmp_path / "nvidia0")
    return become


@pytest.mark.parametrize(
    ("cores", "memory", "workers"),
    [
        (1, 64 << 30, 1),
        (2, 64 << 30, 2),
        (64, 64 << 30, MOST_WORKERS),
        (8, 3 * WORKER_MEMORY, 3),
        (8, WORKER_MEMORY // 2, 1),
    ],
)
def test_a_child_for_each_core_within_the_memory(
    machine: Callable[[int, int], None], cores: int, memory: int, workers: int
) -> None:
    machine(cores, memory)
    assert default_workers("auto") == default_workers("cpu") == workers


def test_one_child_on_a_gpu(machine: Callable[[int, int], None], tmp_path: Path) -> None:
    machine(8, 64 << 30)
    assert default_workers("cuda:0") == 1
    (tmp_path / "nvidia0").touch()
    assert (default_workers("auto"), default_workers("cpu")) == (1, MOST_WORKERS)


def test_a_server_measures_by_itself_where_it_has_a_bundle_that_does(tmp_path: Path) -> None:
    config = Settings(home=tmp_path, models=tmp_path / "models")
    write_generator(config.models, "hgm3-x", model="hgm3")
    assert default_roles(config, 1) == "hgm3+text,edit"
    write_evaluator(config.models)
    assert default_roles(config, 1) == "hgm3+text+evaluator,edit"
    assert parse_roles(default_roles(config, 2)) == [("hgm3", "text", "evaluator"), ("hgm3", "text"), ("edit",)]


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[list[list[tuple[str, ...]]]]:
    """The roles of the servers that a test starts, without any process."""
    found: list[list[tuple[str, ...]]] = []
    monkeypatch.setenv("MAREY_HOME", str(tmp_path))
    monkeypatch.setattr(Supervisor, "run", lambda self: found.append(list(self.roles)))
    mask = os.umask(0o077)  # the command sets its own
    yield found
    os.umask(mask)


def test_the_number_of_children_can_be_said(started: list[list[tuple[str, ...]]]) -> None:
    for words in (["--workers", "3"], ["--with", "text,edit"]):
        assert CliRunner().invoke(app, ["serve", *words]).exit_code == 0
    first, second = started
    assert (len(first), first[1] == first[2], first[-1]) == (4, True, ("edit",))
    assert second == [("text",), ("edit",)]


def test_the_number_of_children_beside_their_roles_is_refused(started: list[list[tuple[str, ...]]]) -> None:
    refused = CliRunner().invoke(app, ["serve", "--workers", "2", "--with", "text"])
    assert (refused.exit_code, started) == (2, [])
    assert "--workers: is given beside --with" in refused.output
