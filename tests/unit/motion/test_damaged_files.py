"""Damaged files of every format that is read: the two kinds of error of readers come out and nothing else, not even a
warning, within two seconds of processor time and 256 MiB a file. USD is in tests/clients."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.support.archives import REPOSITORY, archive
from tests.support.fuzzing import FORMATS

OWN = list(FORMATS)
ARCHIVED = [name for name, each in FORMATS.items() if each.archived]


def read_damaged(format: str, source: str, count: int, seed: int) -> None:
    command = [sys.executable, "-m", "tests.support.fuzzing", format, source, str(count), str(seed)]
    one = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False, env=os.environ | one)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr[-4000:]}"


@pytest.mark.parametrize("format", OWN)
def test_damaged_files_are_refused_or_read(format):
    read_damaged(format, "own", 60, 1)


@pytest.mark.data
@pytest.mark.parametrize("format", ARCHIVED)
def test_damaged_files_of_other_programs_are_refused_or_read(format):
    for name in FORMATS[format].archived:
        archive(f"rigs/{name}")
    read_damaged(format, "archived", 30, 1)


@pytest.mark.slow
@pytest.mark.parametrize("format", OWN)
def test_ten_thousand_damaged_files(format):
    read_damaged(format, "own", 10_000, 2)


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize("format", ARCHIVED)
def test_ten_thousand_damaged_files_of_other_programs(format):
    for name in FORMATS[format].archived:
        archive(f"rigs/{name}")
    read_damaged(format, "archived", 10_000, 2)
