"""The model registry: found by entry points, read without torch, and loud about a package that is wrong."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from marey.core.errors import InvalidInput, NotFound
from marey.registry import ModelSpec, Setting, find_model, get_model, model_names, models, resolve

SPEC = "from marey.registry import ModelSpec\nSPEC = ModelSpec('{name}', '', '', handler='a:b', load='a:b')\n"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Install a package that registers models, each `name = value`."""

    def install(package: str, source: str, *lines: str) -> None:
        (tmp_path / f"{package}.py").write_text(source)
        info = tmp_path / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("[marey.models]\n" + "\n".join(lines) + "\n")
        clear()

    def clear() -> None:
        models._registered.cache_clear()
        find_model.cache_clear()

    monkeypatch.syspath_prepend(str(tmp_path))
    yield install
    clear()


def test_reading_every_spec_needs_the_standard_library_alone() -> None:
    code = (
        "import sys; before = set(sys.modules); from marey.registry import find_model, model_names\n"
        "assert all(find_model(name) for name in model_names()) and model_names()\n"
        "found = {name.partition('.')[0] for name in sys.modules.keys() - before}\n"
        "print(sorted(found - sys.stdlib_module_names - {'marey'}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", model_names())
def test_every_reference_of_every_model_is_there(name: str) -> None:
    spec = get_model(name)
    training = spec.training
    references = [spec.handler, spec.load, spec.live, spec.tokenizer, spec.random_bundle]
    references += [spec.live_adherence, spec.self_train, *(each.run for each in spec.ablations)]
    if training is not None:
        references += [training.config, training.train, training.assemble, training.unpack]
    for reference in filter(None, references):
        assert callable(resolve(reference)), reference
    assert len(spec.about.splitlines()) <= 12


def test_a_package_adds_a_model(installed) -> None:
    installed("dancer", SPEC.format(name="dancer"), "dancer = dancer:SPEC")
    assert "dancer" in model_names()
    assert isinstance(get_model("dancer"), ModelSpec)


def test_a_model_that_is_not_there_is_told_with_those_that_are() -> None:
    assert find_model("nowhere") is None
    with pytest.raises(NotFound, match="unknown model 'nowhere'") as told:
        get_model("nowhere")
    assert all(name in (told.value.hint or "") for name in model_names())


@pytest.mark.parametrize(
    ("source", "entry", "message"),
    [
        ("import nowhere_at_all", "dancer = dancer:SPEC", "of the package dancer cannot be imported"),
        ("", "dancer = dancer:SPEC", "of the package dancer cannot be imported"),
        ("SPEC = 1", "dancer = dancer:SPEC", "not the ModelSpec"),
        (SPEC.format(name="walker"), "dancer = dancer:SPEC", "not the ModelSpec of a model of that name"),
        (SPEC.format(name="text"), "text = dancer:SPEC", "not the ModelSpec"),
        (SPEC.format(name="Dancer"), "Dancer = dancer:SPEC", "not the ModelSpec"),
    ],
)
def test_a_package_that_is_wrong_is_named_and_hides_no_other(installed, source: str, entry: str, message: str) -> None:
    others = model_names()
    installed("dancer", source, entry)
    sys.modules.pop("dancer", None)
    assert set(others) < set(model_names())
    with pytest.raises(InvalidInput, match=message):
        find_model(entry.partition(" ")[0])
    assert all(find_model(name) for name in others)


def test_two_packages_cannot_register_one_name(installed) -> None:
    installed("dancer", SPEC.format(name="dancer"), "dancer = dancer:SPEC")
    installed("ballet", SPEC.format(name="dancer"), "dancer = ballet:SPEC")
    with pytest.raises(InvalidInput, match="two installed packages register the model 'dancer'"):
        model_names()


def test_a_setting_has_a_range_and_a_kind() -> None:
    steps, heat = Setting("steps", 1, 100, 10, whole=True), Setting("heat", 0.5, 2.0, 1.0)
    checked = steps.check(8.0), heat.check(2)
    assert checked == (8, 2.0)
    assert [type(value) for value in checked] == [int, float]
    for setting, value, message in (
        (steps, 8.5, "steps: is 8.5, not a whole number"),
        (steps, 0, "steps: 0 is outside 1 to 100"),
        (heat, 2.5, "heat: 2.5 is outside 0.5 to 2"),
    ):
        with pytest.raises(InvalidInput, match=message):
            setting.check(value)
