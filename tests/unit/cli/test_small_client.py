"""The client without extras says which one a command needs."""

from __future__ import annotations

import subprocess
import sys

import pytest

MISSING = ("torch", "numpy", "pydantic_settings", "sqlalchemy", "fastapi", "celery", "psycopg", "redis")


@pytest.mark.parametrize(
    ("arguments", "extra"),
    [
        (["generate", "a person waves"], "worker"),
        (["serve"], "worker"),
        (["worker", "hgm3"], "worker"),
        (["scheduler"], "server"),
        (["api"], "server"),
        (["admin", "gc"], "server"),
        (["convert", "a.npz", "a.bvh"], "motion"),
        (["render", "a.npz", "-o", "a.png"], "motion"),
        (["stream", "a person waves", "-o", "a.bvh"], "motion"),
        (["text", "parse", "a person waves"], "worker"),
        (["train", "hgm3", "tokenizer", "data", "--run", "run", "--steps", "1"], "train"),
        (["data", "inspect", "data"], "worker"),
    ],
)
def test_a_command_that_needs_an_extra_exits_2_and_names_it(arguments: list[str], extra: str, tmp_path: object) -> None:
    code = f"import sys; sys.modules.update(dict.fromkeys({MISSING})); from marey.cli.main import run; run()"
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False, cwd=None
    )
    assert done.returncode == 2, done.stderr
    assert f"pip install 'marey[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr
