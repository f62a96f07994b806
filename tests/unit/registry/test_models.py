"""The model registry: found by entry points, read without torch, and loud about a package that is wrong."""

from __future__ import annotations

import subprocess
import sys
from itertools import count
from pathlib import Path

import pytest

from marey.core.errors import InvalidInput, NotFound, PluginError
from marey.registry import ModelSpec, Setting, find_model, get_model, model_names, resolve
from tests.support.plugins import installed, write_distribution

NUMBERS = count()
SPEC = "from marey.registry import ModelSpec\nSPEC = ModelSpec('{name}', '', '', handler='a:b', load='a:b')\n"


def dancer(folder: Path, source: str, entry: str = "dancer = {module}:SPEC") -> Path:
    """Write a plug-in of one module that registers a model."""
    module = f"dancer_{next(NUMBERS)}"  # a module of one name is imported once a process
    return write_distribution(folder, module, {module: source}, f"[marey.models]\n{entry.format(module=module)}\n")


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


def test_a_package_adds_a_model(tmp_path: Path) -> None:
    with installed(dancer(tmp_path, SPEC.format(name="dancer"))):
        assert "dancer" in model_names()
        assert isinstance(get_model("dancer"), ModelSpec)
    assert "dancer" not in model_names()


def test_a_model_that_is_not_there_is_told_with_those_that_are() -> None:
    assert find_model("nowhere") is None
    with pytest.raises(NotFound, match="unknown model 'nowhere'") as told:
        get_model("nowhere")
    assert all(name in (told.value.hint or "") for name in model_names())


@pytest.mark.parametrize(
    ("source", "entry", "message"),
    [
        ("import nowhere_at_all", "dancer", "cannot be loaded: ModuleNotFoundError"),
        ("", "dancer", "cannot be loaded: AttributeError"),
        ("SPEC = 1", "dancer", "is not the ModelSpec of the name 'dancer'"),
        (SPEC.format(name="walker"), "dancer", "is not the ModelSpec of the name 'dancer'"),
        (SPEC.format(name="text"), "text", "cannot be loaded: ValueError: a model cannot be named 'text'"),
        (SPEC.format(name="Dancer"), "Dancer", "cannot be loaded: ValueError: a model cannot be named 'Dancer'"),
    ],
)
def test_a_package_that_is_wrong_is_named_and_hides_no_other(
    tmp_path: Path, source: str, entry: str, message: str
) -> None:
    others = model_names()
    with installed(dancer(tmp_path, source, entry + " = {module}:SPEC")):
        assert set(others) < set(model_names())
        with pytest.raises(PluginError, match=message) as raised:
            find_model(entry)
        assert "(dancer_" in str(raised.value.where)
        assert all(find_model(name) for name in others)


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
