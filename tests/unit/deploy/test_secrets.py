"""`deploy/make-secrets`."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from cryptography.fernet import Fernet
from sqlalchemy import make_url

from tests.support.marey import REPOSITORY

SCRIPT = REPOSITORY / "deploy" / "make-secrets"
OURS = {"database_url", "queue_url", "s3_access_key", "s3_secret_key", "webhook_key", "text_key"}
SOMEBODY = 65534
THEIRS = {"postgres_password", "queue_password"}


def test_what_is_drawn_fits_together(secrets: dict[str, str]) -> None:
    assert set(secrets) == OURS | THEIRS | {"objectstore.env"}
    url = make_url(secrets["database_url"])
    assert (url.password, url.host, url.database) == (secrets["postgres_password"], "postgres", "marey")
    assert secrets["queue_url"] == f"redis://:{secrets['queue_password']}@redis:6379/0"
    assert Fernet(secrets["webhook_key"])
    given = dict(line.split("=") for line in secrets["objectstore.env"].splitlines())
    assert given == {"AWS_ACCESS_KEY_ID": secrets["s3_access_key"], "AWS_SECRET_ACCESS_KEY": secrets["s3_secret_key"]}
    drawn = [secrets[name] for name in sorted(THEIRS | {"s3_access_key", "s3_secret_key", "text_key"})]
    assert len(set(drawn)) == 5
    assert all(len(value) == 48 for value in drawn)


def test_a_second_run_keeps_what_is_there_and_draws_what_is_missing(tmp_path: Path) -> None:
    subprocess.run([SCRIPT, tmp_path], check=True)
    before = {path.name: path.read_text() for path in tmp_path.iterdir()}
    (tmp_path / "webhook_key").unlink()
    (tmp_path / "queue_url").unlink()
    subprocess.run([SCRIPT, tmp_path], check=True)
    after = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert after.pop("webhook_key") != before.pop("webhook_key")
    assert after == before, "without a file left behind"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_root_gives_each_secret_to_the_user_who_reads_it(tmp_path: Path) -> None:
    subprocess.run([SCRIPT, tmp_path], check=True)
    found = {path.name: (path.stat().st_uid, path.stat().st_mode & 0o777) for path in tmp_path.iterdir()}
    assert {name for name, owner in found.items() if owner == (10001, 0o600)} == OURS
    assert {name for name, owner in found.items() if owner == (999, 0o600)} == THEIRS
    assert found["objectstore.env"] == (0, 0o600), "read by Compose itself"
    assert tmp_path.stat().st_mode & 0o777 == 0o700


@pytest.fixture
def folder_of_somebody() -> Iterator[Path]:
    """A folder that every user may reach (pytest's own are closed to others), owned by one who is not root."""
    folder = Path(tempfile.mkdtemp(prefix="marey-"))
    if os.geteuid() == 0:
        os.chown(folder, SOMEBODY, SOMEBODY)
    yield folder
    shutil.rmtree(folder)


def test_somebody_else_keeps_them_behind_a_folder_of_his_own(folder_of_somebody: Path) -> None:
    copy = shutil.copy(SCRIPT, folder_of_somebody)
    folder = folder_of_somebody / "secrets"
    user = ["setpriv", f"--reuid={SOMEBODY}", f"--regid={SOMEBODY}", "--clear-groups"] if os.geteuid() == 0 else []
    subprocess.run([*user, copy], check=True)
    assert folder.stat().st_mode & 0o777 == 0o700
    modes = {path.name: path.stat().st_mode & 0o777 for path in folder.iterdir()}
    assert modes == dict.fromkeys(OURS | THEIRS, 0o644) | {"objectstore.env": 0o600}
