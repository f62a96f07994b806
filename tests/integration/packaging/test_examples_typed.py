"""The examples against the types of the installed wheel, in an environment to which the checkout is closed."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.marey import REPOSITORY
from tests.support.wheels import make_environment, this_wheel

CHECKER = Path(sys.executable).with_name("basedpyright")
WRONG = """
from marey.client import Client

with Client() as client:
    job = client.jobs.submit(["a person walks"], seconds="long")
    print(job.progress)
"""


@pytest.fixture
def project(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project of a user: the examples, the installed wheel, strict checks."""
    made = make_environment(tmp_path / "environment", [this_wheel(tmp_path_factory)], borrow=True)
    left_out = shutil.ignore_patterns("__pycache__", "blender")  # Blender's modules have no types
    shutil.copytree(REPOSITORY / "examples", tmp_path / "examples", ignore=left_out)
    settings = {
        "include": ["examples"], "typeCheckingMode": "strict", "pythonVersion": "3.11",
        "venvPath": str(tmp_path), "venv": made.folder.name,
    }  # fmt: skip
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    return tmp_path


def check(project: Path) -> list[str]:
    """The errors that basedpyright finds in the files it was given, `file: message`."""
    done = subprocess.run(
        [str(CHECKER), "-p", str(project), "--outputjson"], cwd=project, capture_output=True, text=True, timeout=300,
        check=False,
    )  # fmt: skip
    found = json.loads(done.stdout)
    assert found["summary"]["filesAnalyzed"] == len(list((project / "examples").glob("*.py")))
    return [f"{Path(each['file']).name}: {each['message']}" for each in found["generalDiagnostics"]]


def test_the_examples_are_strictly_typed_and_mistakes_are_found(project: Path) -> None:
    (project / "examples" / "wrong.py").write_text(WRONG)
    found = check(project)
    assert {line.partition(":")[0] for line in found} == {"wrong.py"}  # the examples have no mistake
    assert any('"seconds"' in line for line in found)
    assert any('"progress"' in line for line in found)
