"""Server, worker and training tools from the wheel, with bundles from wheels, in an environment that borrows the
development packages: commands run outside the checkout, which is closed to them.

`make test` starts no server from it: that the wheel holds every file is checked in `test_client_wheel.py`.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from marey.bundles.places import OPEN, STARTER, distributions
from marey.motion.clip import load_npz
from marey.motion.io.bvh import read_bvh
from marey.registry import get_model, model_names
from tests.support.evaluations import write_evaluator
from tests.support.models import GENERATORS, TEXT_BUNDLES, add_text_bundles, random_bundle
from tests.support.releases import Release, installed_release, wait_until
from tests.support.wheels import Environment, bundles_wheel, make_environment, this_wheel


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Environment:
    """Marey and both distributions of bundles: small ones in place of those that were trained."""
    folder = tmp_path_factory.mktemp("server")
    models = folder / "models"
    for model in model_names():
        for name in get_model(model).bundles:
            random_bundle(model, models / name)
    write_evaluator(models, "evaluator-starter")
    add_text_bundles(models)
    bundles = [bundles_wheel(family, models, folder / family) for family in ("open", "starter")]
    return make_environment(folder / "environment", [this_wheel(tmp_path_factory), *bundles], borrow=True)


@pytest.fixture(scope="module")
def home() -> Iterator[Path]:
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    yield home
    shutil.rmtree(home, ignore_errors=True)


@pytest.fixture(scope="module")
def marey(environment: Environment, home: Path, tmp_path_factory: pytest.TempPathFactory) -> Release:
    """The commands; MAREY_MODELS is not set."""
    folder = tmp_path_factory.mktemp("elsewhere")
    return installed_release(environment, {"MAREY_HOME": str(home), "MAREY_LIVE_SLOTS": "0"}, folder)


@pytest.fixture(scope="module")
def served(marey: Release) -> Iterator[Release]:
    """The commands, with a server that runs."""
    log = marey.folder / "serve.log"
    with marey.running(log, "serve", "--port", "0"):
        wait_until(lambda: "Ready." in log.read_text(), log)
        yield marey


def test_installed_bundles_are_found(marey: Release) -> None:
    listed = [json.loads(line) for line in marey.run("models", "list", "--local", "--json").splitlines()]
    assert sorted(model["name"] for model in listed) == sorted(GENERATORS)
    assert all(model["random"] for model in listed), "those of the wheels, not those of the checkout"


def test_a_motion_is_generated_converted_and_drawn(marey: Release) -> None:
    marey.run("generate", "a person walks", "--seconds", "1", "-o", "made", "--name-template", "walk")
    made = marey.folder / "made"
    marey.run("convert", "made/walk.bvh", "made/again.npz")
    bvh, again = read_bvh(made / "walk.bvh"), load_npz(made / "again.npz")
    order = [bvh.skeleton.joint_names.index(name) for name in again.skeleton.joint_names]
    assert np.abs(bvh.joints()[:, order] - again.joints).max() < 0.01  # m: the features in between are lossy
    marey.run("render", "made/walk.npz", "-o", "made/walk.png")
    marey.run("render", "made/walk.npz", "-o", "made/walk.html")
    assert (made / "walk.png").read_bytes().startswith(b"\x89PNG")
    assert "<script" in (made / "walk.html").read_text()


@pytest.mark.slow
def test_a_server_makes_motions_and_pages_to_review_them(served: Release) -> None:
    line = json.loads(served.run("submit", "a person waves", "--seconds", "1", "--fetch", "fetched", "--json"))
    assert line["state"] == "succeeded"
    assert load_npz(line["files"]["npz"]).frames == 20
    served.run("review", line["job"], "-o", "review.html")
    assert "a person waves" in (served.folder / "review.html").read_text()
    checks = [json.loads(each) for each in served.run("doctor", "--json").splitlines()]
    assert {*GENERATORS, *TEXT_BUNDLES, "evaluator-starter"} <= {
        check["message"].partition("@")[0] for check in checks if check["name"] == "models"
    }


@pytest.mark.slow
def test_pages_and_files_of_the_api_are_in_the_wheel(served: Release, home: Path) -> None:
    import httpx2

    server = json.loads((home / "server.json").read_text())
    with httpx2.Client(base_url=server["url"]) as http:
        for path in ("/docs", "/live"):
            answer = http.get(path)
            assert answer.status_code == 200, answer.text
            assert "<html" in answer.text


@pytest.mark.parametrize("command", [("train", "hgm3", "masked"), ("data", "prepare"), ("eval", "run")])
def test_training_and_evaluation_tools_are_there(marey: Release, command: tuple[str, ...]) -> None:
    assert f"marey {' '.join(command)}" in marey.run(*command, "--help")


def test_a_missing_bundle_names_its_distribution(marey: Release, tmp_path: Path) -> None:
    bare = replace(marey, environment={**marey.environment, "MAREY_HOME": str(tmp_path)})
    packages = next(Path(marey.command[0]).parents[1].glob("lib/python*/site-packages"))
    aside = [(path, path.with_name(f"{path.name}.aside")) for path in packages.glob("marey_bundles_*.dist-info")]
    for path, hidden in aside:
        path.rename(hidden)
    try:
        for arguments in (("generate", "a person walks"), ("generate", "x", "--bundle", "hgm3-open")):
            with pytest.raises(AssertionError, match=f"pip install {OPEN}"):
                bare.run(*arguments)
        for name, package in (("srl-light", OPEN), ("hgm3-starter", STARTER)):
            with pytest.raises(AssertionError, match=f"pip install {package}"):
                bare.run("generate", "x", "--bundle", name)
    finally:
        for path, hidden in aside:
            hidden.rename(path)
    assert set(distributions().values()) == {OPEN, STARTER}
