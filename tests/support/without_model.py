"""A copy of the checkout without one model, with an environment of its own that does not know it either.

Lines of the documents that name a file of the model are left out with it: they belong to its deletion.

python -m tests.support.without_model MODEL FOLDER
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from tests.support.marey import REPOSITORY
from tests.support.models import is_of
from tests.support.wheels import DEVELOPMENT, Environment, make_environment

GIT = ("git", "-c", "user.name=test", "-c", "user.email=test@example.invalid")


def tracked() -> list[str]:
    """Every file under version control that is there."""
    done = subprocess.run(["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, text=True, check=True)
    return [name for name in done.stdout.split("\0") if name and (REPOSITORY / name).is_file()]


def copy_without(model: str, tree: Path) -> Environment:
    """Copy the checkout without a model's own files and lines, and install the copy beside it."""
    for name in tracked():
        if not is_of(model, name):
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(REPOSITORY / name, tree / name)
    _drop_lines(tree / "pyproject.toml", lambda line: line.startswith(f'{model} = "marey.models.'))
    _drop_lines(tree / "models/packages/starter/pyproject.toml", lambda line: line.startswith(f'"../../{model}-'))
    _drop_lines(tree / "mkdocs.yml", lambda line: f"models/{model}-" in line)
    for page in tree.rglob("*.md"):
        page.write_text(_without_files(page.read_text(encoding="utf-8"), model), encoding="utf-8")
    made = make_environment(tree / ".venv", (), borrow=True)
    uv = str(DEVELOPMENT.parents[2] / "bin" / "uv")
    install = (
        uv,
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-index",
        "--no-build-isolation",
        "--no-cache",
        "--no-config",
    )
    (tree / ".venv" / "bin" / "zensical").symlink_to(DEVELOPMENT.parents[2] / "bin" / "zensical")  # it imports no Marey
    subprocess.run([*install, "--python", made.python, "-e", str(tree)], check=True)
    subprocess.run([*GIT, "init", "-q"], cwd=tree, check=True)
    subprocess.run([*GIT, "add", "-A"], cwd=tree, check=True)
    return made


def _without_files(text: str, model: str) -> str:
    """Drop the lines of a document that name a file or module of the model, and blocks of code that held no others."""
    files = re.compile(rf"\bmarey[./]models[./]{model}\b|\bmodels/{model}-|\bbench_{model}[._]")
    kept = "".join(line for line in text.splitlines(keepends=True) if not files.search(line))
    return re.sub(r"^```\w+\n```\n", "", kept, flags=re.MULTILINE)


def _drop_lines(path: Path, dropped: Callable[[str], bool]) -> None:
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if not dropped(line)]
    assert len(kept) < len(lines), f"{path} has no line of the model"
    path.write_text("".join(kept), encoding="utf-8")


if __name__ == "__main__":
    print(copy_without(sys.argv[1], Path(sys.argv[2])).python)
