"""Where bundles are searched, and what distributions of bundles hold."""

from __future__ import annotations

import json
import logging
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from marey.bundles import choose_bundle, choose_evaluator, choose_live_bundle, find_bundle, list_bundles
from marey.bundles.places import OPEN, STARTER, distributions, folders, installed
from marey.core import checkout
from marey.core.errors import NotFound, Refused
from marey.core.settings import Settings
from marey.registry import get_model, model_names
from tests.support.evaluations import write_generator
from tests.support.live_api import write_bundle
from tests.support.marey import REPOSITORY
from tests.support.models import GENERATORS

PACKAGES = {
    path.parent: tomllib.loads(path.read_text()) for path in REPOSITORY.glob("models/packages/*/pyproject.toml")
}
LICENCE_TEXTS = {
    "Apache-2.0": "apache.org/licenses/LICENSE-2.0",
    "CC-BY-4.0": "creativecommons.org/licenses/by/4.0/",
    "CC-BY-NC-4.0": "creativecommons.org/licenses/by-nc/4.0/",
    "CC-BY-SA-4.0": "creativecommons.org/licenses/by-sa/4.0/",
}
NAME = "marey_test_bundles"


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of installed packages, with a distribution of bundles that must never be imported."""
    folder = tmp_path / "packages"
    (folder / NAME).mkdir(parents=True)
    (folder / NAME / "__init__.py").write_text("raise SystemExit('imported')")
    add_entry_point(folder, NAME, NAME)
    monkeypatch.syspath_prepend(folder)
    installed.cache_clear()
    yield folder
    installed.cache_clear()


def add_entry_point(folder: Path, name: str, value: str) -> None:
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[marey.bundles]\n{name} = {value}\n")


def held(distribution: dict[str, Any]) -> dict[Path, str]:
    return distribution["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]


def test_the_first_folder_wins_the_setting_replaces_the_checkout(tmp_path: Path, packages: Path) -> None:
    given = Settings(home=tmp_path / "home", models=tmp_path / "given")
    unset = Settings(home=tmp_path / "home")
    assert folders(given) == (tmp_path / "given", tmp_path / "home" / "models", packages / NAME)
    assert folders(unset) == (tmp_path / "home" / "models", REPOSITORY / "models", packages / NAME)
    for folder in reversed(folders(given)):
        write_bundle(folder, "known")
        assert find_bundle("known", config=given).path == folder / "known"
    assert [bundle.path for bundle in list_bundles(config=given)] == [tmp_path / "given" / "known"]
    assert NAME not in sys.modules


def test_an_entry_point_that_names_no_package_is_left_out(
    packages: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for number, value in enumerate(("marey_nowhere", "marey_nowhere.bundles", "json.tool")):
        add_entry_point(packages, f"wrong{number}", value)
    with caplog.at_level(logging.WARNING):
        assert installed() == (packages / NAME,)
    assert [record.args[0] for record in caplog.records if record.args] == ["wrong0", "wrong1", "wrong2"]


def test_a_wheel_has_no_checkout(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert checkout.checkout() == REPOSITORY
    for root in (tmp_path / "venv" / "lib" / "python3.11" / "site-packages", tmp_path / "shared"):
        monkeypatch.setattr(checkout, "__file__", str(root / "marey" / "core" / "checkout.py"))
        assert checkout.checkout() is None
    (tmp_path / "pyproject.toml").touch()
    assert checkout.checkout() == tmp_path


@pytest.mark.parametrize("name", [*(name for name in model_names() if get_model(name).bundles), *GENERATORS])
def test_without_a_bundle_its_distribution_is_named(tmp_path: Path, name: str) -> None:
    config = Settings(home=tmp_path, models=tmp_path)
    with pytest.raises(NotFound) as refused:
        choose_bundle(name, config=config)
    known = next(iter(get_model(name).bundles)) if name in model_names() else name
    assert f"pip install {distributions()[known]}" in (refused.value.hint or "")
    with pytest.raises(NotFound) as refused:
        choose_evaluator(None, config=config)
    assert f"pip install {STARTER}" in (refused.value.hint or "")
    with pytest.raises(NotFound) as refused:
        find_bundle("srl-light", config=config)
    assert f"pip install {OPEN}" in (refused.value.hint or "")
    with pytest.raises(NotFound) as refused:
        find_bundle("of-a-studio", config=config)
    assert "pip" not in (refused.value.hint or "")


def test_every_bundle_of_the_checkout_is_in_one_distribution() -> None:
    found = {Path(source).name: project["project"]["name"] for project in PACKAGES.values() for source in held(project)}
    assert found == distributions()
    assert set(found) == {path.parent.name for path in REPOSITORY.glob("models/*/manifest.json")}


@pytest.mark.parametrize("folder", PACKAGES, ids=lambda folder: folder.name)
def test_a_distribution_states_its_licences_and_every_credit(folder: Path) -> None:
    project = PACKAGES[folder]["project"]
    text = (folder / "LICENSE").read_text()
    manifests = [json.loads((folder / source / "manifest.json").read_text()) for source in held(PACKAGES[folder])]
    licences = project["license"].split(" AND ")
    assert {manifest["licence"] for manifest in manifests} == set(licences)
    assert all(LICENCE_TEXTS[licence] in text for licence in licences)
    assert all(source["credit"] in text for manifest in manifests for source in manifest["data"])
    assert project["license-files"] == ["LICENSE"]
    (package,) = project["entry-points"]["marey.bundles"].values()
    assert all(target == f"{package}/{Path(source).name}" for source, target in held(PACKAGES[folder]).items())


@pytest.mark.parametrize("model", model_names())
def test_of_a_models_bundles_the_preferred_one_is_used(tmp_path: Path, model: str) -> None:
    config = Settings(home=tmp_path, models=tmp_path)
    write_generator(tmp_path, "a-studio", model=model)
    assert choose_bundle(model, config=config).manifest.name == "a-studio"
    for name in reversed(tuple(get_model(model).bundles)):
        write_generator(tmp_path, name, model=model)
        assert choose_bundle(model, config=config).manifest.name == name
    assert choose_bundle("a-studio", config=config).manifest.name == "a-studio"


def test_bundles_whose_terms_are_refused_are_passed_over(tmp_path: Path) -> None:
    config = Settings(home=tmp_path, models=tmp_path, require_licence="commercial")
    model, preferred = next((name, get_model(name).bundles) for name in model_names() if get_model(name).bundles)
    write_generator(tmp_path, next(iter(preferred)), model=model, licence="CC-BY-NC-4.0")
    with pytest.raises(Refused, match="does not allow commercial use"):
        choose_bundle(model, config=config)
    write_generator(tmp_path, "a-studio", model=model, licence="CC-BY-4.0")
    assert choose_bundle(model, config=config).manifest.name == "a-studio"
    with pytest.raises(Refused):
        choose_bundle(next(iter(preferred)), config=config)


def test_live_workers_load_the_bundle_that_the_settings_name(tmp_path: Path) -> None:
    for name, model in (("first", "walker"), ("second", "walker"), ("third", "runner")):
        write_generator(tmp_path, name, model=model)
    config = Settings(home=tmp_path, models=tmp_path)
    named = {live: config.model_copy(update={"live_model": live}) for live in ("second", "third")}
    assert choose_live_bundle("walker", config=config).manifest.name == "first"
    assert choose_live_bundle("walker", config=named["second"]).manifest.name == "second"
    assert choose_live_bundle("walker", config=named["third"]).manifest.name == "first"
