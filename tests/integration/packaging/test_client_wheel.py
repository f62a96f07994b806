"""The client from its wheel, in an environment that holds what the wheel requires and nothing else."""

from __future__ import annotations

import csv
import hashlib
import json
import zipfile
from pathlib import Path

import pytest

from tests.support.live_api import LiveApi
from tests.support.releases import Release, installed_release
from tests.support.wheels import Environment, make_environment, this_wheel

CONTENT = b"motion"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return this_wheel(tmp_path_factory)


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    return make_environment(tmp_path_factory.mktemp("client") / "environment", [wheel], borrow=False)


@pytest.fixture
def marey(environment: Environment, tmp_path: Path) -> Release:
    """The client, without a server."""
    return installed_release(environment, {"MAREY_HOME": str(tmp_path / "home")}, tmp_path)


def test_a_wheel_adds_one_package_to_an_environment(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    version = wheel.name.split("-")[1]
    assert {name.split("/")[0] for name in names} == {"marey", f"marey-{version}.dist-info"}
    assert "marey/__init__.py" not in names, "the namespace is open to plug-ins"


def test_a_wheel_holds_every_file_of_the_packages(wheel: Path, checkout: list[str]) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if name.startswith("marey/")}
    portions = ("shared/marey/", "workers/marey/", "services/marey/", "migrations/marey/")
    expected = {f"marey/{file.split('/marey/', 1)[1]}" for file in checkout if file.startswith(portions)}
    assert names == expected
    assert {name.rpartition(".")[2] for name in names} >= {"py", "toml", "json", "js", "css", "html", "mako", "txt"}


def test_the_client_needs_no_other_package(environment: Environment, marey: Release) -> None:
    installed = {path.name.partition("-")[0] for path in environment.packages.glob("*.dist-info")}
    assert not installed & {"numpy", "torch", "sqlalchemy", "fastapi", "celery"}
    version = next(environment.packages.glob("marey-*.dist-info")).name.removesuffix(".dist-info").split("-")[1]
    assert marey.run("--version") == f"{version}\n"
    assert "submit" in marey.run("--help")


def test_public_packages_are_typed_and_tell_their_version(wheel: Path, environment: Environment) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    public = [name.removesuffix("/py.typed").replace("/", ".") for name in names if name.endswith("/py.typed")]
    assert "marey.client" in public
    script = f"import importlib\nfor name in {public}: print(importlib.import_module(name).__version__)"
    python = Release((environment.python,), environment.environ({}), environment.folder)
    assert set(python.run("-c", script).split()) == {wheel.name.split("-")[1]}


@pytest.mark.parametrize("command", ["generate", "serve", "train"])
def test_help_needs_no_extra(marey: Release, command: str) -> None:
    assert f"marey {command}" in marey.run(command, "--help")


@pytest.mark.parametrize(
    ("arguments", "extra"),
    [
        (("generate", "a person walks"), "worker"),
        (("models", "list", "--local"), "server"),
        (("convert", "a.bvh", "b.npz"), "motion"),
    ],
)
def test_a_command_that_needs_an_extra_names_it(marey: Release, arguments: tuple[str, ...], extra: str) -> None:
    with pytest.raises(AssertionError, match=rf"pip install 'marey\[{extra}\]'"):
        marey.run(*arguments)


def test_motions_are_ordered_watched_and_fetched(environment: Environment, api: LiveApi, tmp_path: Path) -> None:
    values = {"MAREY_HOME": str(tmp_path / "home"), "MAREY_SERVER": api.url, "MAREY_KEY": api.key}
    marey = installed_release(environment, values, tmp_path)
    (tmp_path / "prompts.csv").write_text("prompt,name\na person walks,walk\na person waves,wave\n")
    job = json.loads(marey.run("submit", "-f", "prompts.csv", "--json"))["id"]
    assert job in marey.run("jobs", "list", "--json")
    api.work(CONTENT)
    marey.run("jobs", "wait", job)
    marey.run("fetch", job, "-o", "motions", "--format", "npz")
    files = sorted((tmp_path / "motions").glob("*.npz"))
    assert [hashlib.sha256(file.read_bytes()).digest() for file in files] == [hashlib.sha256(CONTENT).digest()] * 2
    with (tmp_path / "motions" / "manifest.csv").open(newline="") as stream:
        assert [row["name"] for row in csv.DictReader(stream)] == ["walk", "wave"]


def test_the_checkout_is_closed_to_it(environment: Environment) -> None:
    from tests.support.marey import REPOSITORY

    script = f"print(open({str(REPOSITORY / 'README.md')!r}).read())"
    with pytest.raises(AssertionError, match="the checkout is closed"):
        Release((environment.python,), environment.environ({}), environment.folder).run("-c", script)
