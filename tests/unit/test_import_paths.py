"""Import paths in text: strings, comments, documents and settings name modules that exist."""

from __future__ import annotations

import io
import re
import subprocess
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.marey import REPOSITORY

PORTIONS = ("shared", "workers", "services", "migrations")
OLD = re.compile(rf"(?<![\w./*-])({'|'.join(PORTIONS)})[./](?!marey\b)[a-z_]\w*")
"""A path of the time when each of these folders was a package of its own."""
NEW = re.compile(r"(?<![\w./@-])marey((?:\.(?!__)[A-Za-z_]\w*)+)")
STORED = {
    "tests/unit/importing/test_encoders.py": "T5's names of tensors",
    "workers/marey/importing/encoder_files.py": "T5's names of tensors",
    "CHANGELOG.md": "says what a user replaces",
    "docs/decisions/0015-one-package-by-noun.md": "describes the layout before",
    "tests/unit/test_import_paths.py": "names them to find them",
    "models/srl-light/manifest.json": "the recorded command of its training",
}
"""Files and folders that keep old paths, with the reason."""
FOREIGN = ("swagger-ui-bundle.js", "swagger-ui.css", "three.min.js")


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of a file with their numbers; of Python that may hold an old path the imports, strings and comments alone:
    code may have a variable of a package's name."""
    source = path.read_text(encoding="utf-8")
    if path.suffix != ".py" or not OLD.search(source):
        yield from enumerate(source.splitlines(), 1)
        return
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        first = not token.line[: token.start[1]].strip()
        if token.type in (tokenize.STRING, tokenize.COMMENT):
            yield from enumerate(token.string.splitlines(), token.start[0])
        elif first and token.string in ("import", "from"):
            yield token.start[0], token.line


def tracked() -> list[str]:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"there is no history here: {done.stderr.strip()}")
    return [name for name in done.stdout.splitlines() if (REPOSITORY / name).is_file()]


@pytest.fixture(scope="module")
def lines() -> list[tuple[str, str]]:
    """Every line of text with its place."""
    found: list[tuple[str, str]] = []
    for name in tracked():
        if name.endswith((".safetensors", ".png", *FOREIGN)):
            continue
        found += [(f"{name}:{number}", line) for number, line in texts(REPOSITORY / name)]
    return found


def missing(dotted: str) -> bool:
    """Return True if `marey` + dotted is neither a module nor a name in one."""
    *parents, last = dotted.strip(".").split(".")
    folders = [REPOSITORY / portion / "marey" for portion in PORTIONS]
    for depth, part in enumerate([*parents, last]):
        below = [folder / part for folder in folders if (folder / part).is_dir()]
        files = [folder / f"{part}.py" for folder in folders if (folder / f"{part}.py").is_file()]
        if below:
            folders = below
            continue
        if files:
            return depth < len(parents) and not any(_holds(file, dotted, depth + 1) for file in files)
        return depth == 0 or not any(_holds(folder / "__init__.py", dotted, depth) for folder in folders)
    return False


def _holds(file: Path, dotted: str, depth: int) -> bool:
    name = dotted.strip(".").split(".")[depth]
    return file.is_file() and re.search(rf"\b{name}\b", file.read_text(encoding="utf-8")) is not None


def test_no_text_keeps_a_path_of_the_four_packages(lines: list[tuple[str, str]]) -> None:
    found = [
        f"{place}: {line.strip()}" for place, line in lines if OLD.search(line) and not place.startswith(tuple(STORED))
    ]
    assert "\n".join(found) == ""


def test_every_exception_is_needed(lines: list[tuple[str, str]]) -> None:
    assert [
        name for name in STORED if not any(place.startswith(name) and OLD.search(line) for place, line in lines)
    ] == []


def test_modules_that_are_named_exist(lines: list[tuple[str, str]]) -> None:
    packages = {
        path.name for portion in PORTIONS for path in (REPOSITORY / portion / "marey").iterdir() if path.is_dir()
    }
    wrong = [
        f"{place}: marey{dotted}"
        for place, line in lines
        for dotted in NEW.findall(line)
        if dotted.split(".")[1] in packages and missing(dotted) and not place.startswith(tuple(STORED))
    ]
    assert "\n".join(wrong) == ""


@pytest.mark.parametrize(
    "text",
    [
        "python -m workers.hgm3.practice",
        "`shared/jobs`",
        '"shared.runtime.status"',
        "services.api.app:create_app",
        "from workers.stroller import x",
    ],
)
def test_old_paths_are_found(text: str) -> None:
    assert OLD.search(text)


@pytest.mark.parametrize(
    "text", ["shared/marey/jobs", "marey.workers.x", "/srv/shared/data", "the workers. They", "workers/**"]
)
def test_other_text_is_left_alone(text: str) -> None:
    assert not OLD.search(text)


def test_a_module_is_missed() -> None:
    assert not missing(".core.errors")
    assert not missing(".core.errors.NotFound")
    assert not missing(".bundles.find_bundle")
    assert missing(".core.nowhere")
    assert missing(".core.errors.Nothing")
    assert missing(".jobs.tenant_types")
