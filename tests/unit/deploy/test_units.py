"""The systemd units: valid, hardened, and with settings and secrets that Marey reads."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from marey.core.settings import BY_FILE, Settings
from tests.support.units import COMMON, PROGRAM, S3, SERVICES, environment_file, read_unit, replaced

ANALYZE = shutil.which("systemd-analyze")
needs_systemd = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")
EXPOSURE = 2.0
"""Highest exposure level, of 10, that `systemd-analyze security` may find."""


def analyze(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    assert ANALYZE is not None
    environment = {**os.environ, "SYSTEMD_UNIT_PATH": f"{folder}:", "SYSTEMD_COLORS": "0"}
    return subprocess.run(
        [ANALYZE, *arguments], env=environment, capture_output=True, text=True, check=False, timeout=60
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return replaced(tmp_path, {PROGRAM: sys.executable})


@needs_systemd
@pytest.mark.parametrize("name", ["marey.target", *SERVICES])
def test_systemd_finds_no_fault(name: str, folder: Path) -> None:
    found = analyze(folder, "verify", "--man=no", name)
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")


@needs_systemd
def test_systemd_would_find_one(folder: Path) -> None:
    unit = folder / "marey-api.service"
    unit.write_text(unit.read_text().replace("Restart=always", "Restart=sometimes\nNoSuchOption=yes"))
    assert "NoSuchOption" in analyze(folder, "verify", "--man=no", unit.name).stderr


@needs_systemd
@pytest.mark.parametrize("name", SERVICES)
def test_little_of_the_machine_is_open_to_a_service(name: str, folder: Path) -> None:
    found = analyze(folder, "security", "--offline=yes", "--no-pager", name)
    level = re.search(r"Overall exposure level for .*: ([0-9.]+)", found.stdout)
    assert level is not None, found.stdout + found.stderr
    assert float(level[1]) <= EXPOSURE


@pytest.mark.parametrize("name", SERVICES)
def test_services_run_as_a_user_and_are_started_again(name: str) -> None:
    unit = read_unit(name)
    assert unit.one("User") == "marey"
    assert unit.one("Restart") == ("on-failure" if name == "marey-migrate.service" else "always")
    assert unit.command


def test_every_variable_is_a_setting_and_every_secret_comes_by_a_credential(tmp_path: Path) -> None:
    known = {f"MAREY_{name.upper()}" for name in Settings.model_fields} | {f"MAREY_{n.upper()}_FILE" for n in BY_FILE}
    used: set[str] = set()
    for name in SERVICES:
        unit = read_unit(name, (COMMON, S3))
        variables = unit.environment(tmp_path)
        assert {variable for variable in variables if variable.startswith("MAREY_")} <= known
        files = {Path(value).name for variable, value in variables.items() if variable.endswith("_FILE")}
        assert files == set(unit.credentials)
        assert all(path == f"/etc/marey/secrets/{secret}" for secret, path in unit.credentials.items())
        used |= files
    assert used <= set(BY_FILE)
    assert not any("KEY" in variable or "URL_FILE" in variable for variable in environment_file())


def test_the_text_service_has_no_secret_of_the_database() -> None:
    assert set(read_unit("marey-text.service").credentials) == {"text_key"}


def test_a_watchdog_is_set_only_where_the_process_answers_it() -> None:
    watched = {name for name in SERVICES if read_unit(name).one("WatchdogSec") is not None}
    assert watched == {name for name in SERVICES if read_unit(name).one("Type") == "notify"}
    assert watched == {"marey-api.service", "marey-text.service"}
