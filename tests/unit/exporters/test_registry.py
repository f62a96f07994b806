"""Export formats: what is installed, and plug-ins that cannot be used."""

from __future__ import annotations

import subprocess
import sys
from itertools import count
from pathlib import Path

import pytest

from marey.core.errors import PluginError
from marey.exporters import Exporter, exporter_of, exporters, extension_of
from marey.exporters.exporter import Coordinates
from tests.support.plugins import installed, write_distribution
from tests.support.walker import walker

SECRET = "zanzibar"
OWN = ["bvh", "fbx", "gif", "glb", "mp4", "npz", "smplx", "usd", "vrma", "webp"]
NAMES = count()


def plugin(folder: Path, exporter: str, entry: str = "toy") -> Path:
    """Write a plug-in whose module binds `EXPORTER`."""
    module = f"toy_exporter_{next(NAMES)}"  # a module of one name is imported once a process
    source = (
        f"from marey.exporters import Exporter\n\n\ndef encode(clip, coordinates):\n    return b'toy'\n\n\n{exporter}\n"
    )
    return write_distribution(folder, module, {module: source}, f"[marey.exporters]\n{entry} = {module}:EXPORTER\n")


def test_formats_of_marey_are_installed() -> None:
    found = {each.format: (each.extension, each.media_type) for each in exporters().values()}
    assert found == {
        "bvh": ("bvh", "text/plain; charset=utf-8"),
        "fbx": ("fbx", "application/octet-stream"),
        "gif": ("gif", "image/gif"),
        "glb": ("glb", "model/gltf-binary"),
        "mp4": ("mp4", "video/mp4"),
        "npz": ("npz", "application/x-npz"),
        "smplx": ("smplx.npz", "application/x-npz"),
        "usd": ("usd", "model/vnd.usd"),
        "vrma": ("vrma", "model/gltf-binary"),
        "webp": ("webp", "image/webp"),
    }
    assert list(exporters()) == OWN


def test_films_are_made_on_request_alone() -> None:
    assert [name for name, exporter in exporters().items() if exporter.stored] == ["bvh", "npz"]


def test_the_registry_needs_the_standard_library_only() -> None:
    script = "import sys; from marey.exporters import exporters; exporters(); print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "False\n"


@pytest.mark.parametrize("name", ["bvh", "fbx", "gif", "glb", "npz", "vrma", "webp"])
def test_a_format_says_whether_its_files_hold_the_prompt(name: str) -> None:
    data = exporter_of(name).encode(walker(seconds=0.1, prompt=SECRET), Coordinates())
    found = any(SECRET.encode(coding) in data for coding in ("utf-8", "utf-16-le", "utf-32-le"))
    assert found == exporter_of(name).holds_prompt


@pytest.mark.parametrize("name", ["glb", "npz"])
def test_what_a_format_writes_it_writes_again_to_the_byte(name: str) -> None:
    exporter = exporter_of(name)
    data = exporter.encode(walker(), Coordinates())
    assert exporter.decode is not None
    assert exporter.encode(exporter.decode(data, name, Coordinates()), Coordinates()) == data


def test_a_plugin_is_one_module_and_one_line(tmp_path: Path) -> None:
    exporter = 'EXPORTER = Exporter("toy", "text/x-toy", "ty", False, encode)'
    with installed(plugin(tmp_path, exporter)):
        assert list(exporters()) == sorted([*OWN, "toy"])
        assert exporter_of("toy").encode(walker(), Coordinates()) == b"toy"
        assert extension_of("toy") == "ty"
    assert list(exporters()) == OWN
    assert extension_of("toy") == "toy"
    with pytest.raises(PluginError, match="'toy' is installed"):
        exporter_of("toy")


@pytest.mark.parametrize(
    ("exporter", "entry", "message"),
    [
        ("EXPORTER = 1 / 0", "toy", "ZeroDivisionError"),
        ("EXPORTER = 'toy'", "toy", "not the Exporter of the name"),
        ('EXPORTER = Exporter("toy", "text/x-toy", "ty", False, encode)', "other", "not the Exporter of the name"),
        ('EXPORTER = Exporter("npz", "text/x-toy", "ty", False, encode)', "npz", "two packages register"),
        ('EXPORTER = Exporter("toy", "text/x-toy", "bvh", False, encode)', "toy", "two exporters write"),
    ],
)
def test_a_plugin_that_cannot_be_used_is_named(tmp_path: Path, exporter: str, entry: str, message: str) -> None:
    with installed(plugin(tmp_path, exporter, entry)), pytest.raises(PluginError, match=message) as raised:
        exporters()
    assert "toy_exporter" in str(raised.value)


@pytest.mark.parametrize(
    "values",
    [
        ("../up", "toy", False),
        ("toy", "t..y", False),
        ("toy", "a.toy.file", False),
        ("toy", "toy", True),
        ("t" * 17, "toy", False),
    ],
)
def test_names_that_do_not_fit_and_prompts_that_could_not_be_erased_are_refused(values: tuple[str, str, bool]) -> None:
    name, extension, holds_prompt = values
    with pytest.raises(ValueError, match=r"does not match|needs `decode`"):
        Exporter(name, "text/x-toy", extension, holds_prompt, lambda clip, coordinates: b"")
