"""The public names of the Python API: what can be imported, from where, and at what cost."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("marey.client", "marey.generate", "marey.motion")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there_and_typed(package: str) -> None:
    module = import_module(package)
    assert module.__version__ == version("marey")
    for name in module.__all__:
        assert getattr(module, name) is not None
    assert module.__file__ is not None
    assert (Path(module.__file__).parent / "py.typed").exists()
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        module.nonsense  # noqa: B018


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("marey.client", ("httpx2", "websockets", "numpy", "marey.client.types")),
        ("marey.client.rows", ("httpx2", "websockets", "numpy", "marey.client.types")),
        ("marey.motion", ("numpy", "marey.motion.clip")),
        ("marey.motion.units", ("marey.motion.clip",)),
        ("marey.generate", ("numpy", "torch", "pydantic", "marey.generate.local")),
        ("marey.client.client", ("numpy", "pydantic", "sqlalchemy", "typer", "rich", "platformdirs")),
    ],
)
def test_an_import_brings_only_what_it_needs(module: str, absent: tuple[str, ...]) -> None:
    code = f"import {module}, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(absent) & set(done.stdout.split())


def test_the_reference_names_everything_that_is_public_and_every_example() -> None:
    page = (ROOT / "docs" / "reference" / "python-api.md").read_text(encoding="utf-8")
    for name in ("Client", "LiveStream", "Frame", "Progress", "MareyError", "InvalidItems", "LocalModel", "MotionClip"):
        assert name in page
    errors = import_module("marey.core.errors")
    public = import_module("marey.client").__all__
    assert {name for name in public if hasattr(errors, name)} <= set(re.findall(r"`(\w+)`", page))
    scripts = {path.name for path in (ROOT / "examples").glob("*.py")}
    assert set(re.findall(r"`(\w+\.py)`", page)) == scripts


def test_the_reference_names_every_public_attribute_of_a_client() -> None:
    page = (ROOT / "docs" / "reference" / "python-api.md").read_text(encoding="utf-8")
    with import_module("marey.client").Client("http://127.0.0.1:1", "key") as client:
        public = {name for name in dir(client) if not name.startswith("_")}
    assert public == set(re.findall(r"(?<!\.)\bclient\.(\w+)", page))
