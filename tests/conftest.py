"""Real servers for every test that needs one: started once a run (and once per xdist worker), on first use.

`database_url` a migrated database of the test's own · `engine` its engine · `queue_url` an empty Valkey ·
`folder_store` and `s3_store` empty asset stores · `short_home` an empty folder with a short path, for tests that start
(and kill) servers of their own with `marey.embedded` · `models` the folder in which the process finds bundles.
"""

from __future__ import annotations

import functools
import gc
import itertools
import os
import shutil
import signal
import ssl
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import nullcontext
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import httpx2._transports.default
import psycopg
import pytest
import sqlalchemy as sa
import typer.main
import typer.testing
from hypothesis import HealthCheck, settings
from xdist.remote import Producer
from xdist.scheduler.loadfile import LoadFileScheduling

from marey.core.garbage import end_without_collection
from marey.db import create_engine, upgrade
from marey.embedded import EmbeddedServer, start_postgres, start_valkey
from marey.runtime.queue import redis_client
from marey.storage import FolderStore
from marey.storage.s3 import S3Store
from tests.servers.given import GivenServer, given_server
from tests.servers.swift import Swift

os.environ["PYTHONPATH"] = os.pathsep.join(
    filter(None, [str(Path(__file__).resolve().parents[1]), os.environ.get("PYTHONPATH")])
)
"""Processes that tests start find `tests` there, as this one does by pytest's `pythonpath`."""
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
"""A shell starts what ends in `&` deaf to Ctrl-C, and so would be the commands that tests interrupt."""
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
"""A run starts hundreds of processes: each would compile the whole package anew."""
end_without_collection()
settings.register_profile("shared machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared machine")
"""No test depends on the time that it takes: other work may be on the machine."""
os.environ.setdefault("OMP_NUM_THREADS", "1")
"""Tests run in several processes, which share the cores already; those of more threads set their number."""
typer.testing._get_command = functools.cache(typer.main.get_command)  # pyright: ignore[reportPrivateImportUsage]
"""`CliRunner` builds all commands anew for each that it invokes: a tenth of a second."""


_context = httpx2.create_ssl_context


@functools.cache
def _authorities(_file: str | None, _folder: str | None, trust_env: bool) -> ssl.SSLContext:
    return _context(trust_env=trust_env)


def _shared_context(verify: Any = True, cert: Any = None, trust_env: bool = True) -> ssl.SSLContext:
    if verify is True and cert is None:
        return _authorities(os.environ.get("SSL_CERT_FILE"), os.environ.get("SSL_CERT_DIR"), trust_env)
    return _context(verify, cert, trust_env)


httpx2._transports.default.create_ssl_context = _shared_context  # pyright: ignore[reportPrivateImportUsage]
"""Each of the tests' own clients reads the machine's authorities anew: a twentieth of a second, thousands of times. The
product's clients bring contexts of their own."""


FEW_EXAMPLES = 40
"""Of a property in the fast tests, where it names no number of its own; `make test-all` tries hypothesis' 100."""


def pytest_configure(config: pytest.Config) -> None:
    """Refuse to run where the installed entry points are not those of pyproject.toml: registries would be empty.

    Properties are tried with few examples unless slow tests run, too.
    """
    if "not slow" in config.getoption("markexpr"):
        settings.register_profile("fast tests", settings.get_profile("shared machine"), max_examples=FEW_EXAMPLES)
        settings.load_profile("fast tests")
    project = tomllib.loads((Path(__file__).resolve().parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
    for group, wanted in project["project"]["entry-points"].items():
        missing = wanted.keys() - {entry.name for entry in entry_points(group=group)}
        if missing:
            raise pytest.UsageError(
                f"the installed package has no entry point {min(missing)!r} of {group!r}: run `make setup`, or "
                "`.venv/bin/pip install --no-deps --no-build-isolation -e .`"
            )


FEW_SEEDS = 2
"""Of those that a test is parametrised with, in the fast tests: the others are `slow`."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the further seeds of `@pytest.mark.parametrize("seed", …)` as slow."""
    for item in items:
        seeds = any(mark.args[:1] == ("seed",) for mark in item.iter_markers("parametrize"))
        if seeds and isinstance(item, pytest.Function) and item.callspec.indices["seed"] >= FEW_SEEDS:
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect no garbage while tests are collected, nor look at all that they are in each collection to come: not once
    now, which takes a second of each process."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


SERVED = ("tests/acceptance/extended/", "tests/acceptance/served/")
"""The folders whose tests share a server."""


class _ServerAtATime(LoadFileScheduling):
    """A file of tests in one process, as by `--dist loadfile`, and all files of a folder of `SERVED` in the same."""

    def _split_scope(self, nodeid: str) -> str:
        return next(filter(nodeid.startswith, SERVED), None) or super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling | None:
    """Start the server of each folder of `SERVED` once, not in each process."""
    return _ServerAtATime(config, log) if config.getoption("dist") == "loadfile" else None


TEMPLATE = "migrated"
COPY = f"TEMPLATE {TEMPLATE} STRATEGY FILE_COPY"
"""Half the time of a copy through the write-ahead log."""
_numbers = itertools.count()


MEMORY = Path("/dev/shm")
"""Files in memory, on Linux: a third of the work of making and dropping a database for each test."""
ROOM = 4 << 30
"""Bytes that must be free there."""


@pytest.fixture(scope="session", autouse=True)
def _data_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the default MAREY_HOME out of the user's own data folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_DATA_HOME", str(tmp_path_factory.mktemp("data")))
        yield


@pytest.fixture(scope="session")
def servers_home() -> Iterator[Path]:
    """Folder of the run's servers, in memory where there is room for them."""
    in_memory = MEMORY.is_dir() and shutil.disk_usage(MEMORY).free >= ROOM
    home = Path(tempfile.mkdtemp(prefix="marey-", dir=MEMORY if in_memory else None))
    yield home
    shutil.rmtree(home, ignore_errors=True)


@pytest.fixture
def short_home() -> Iterator[Path]:
    """A MAREY_HOME for one test."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    yield home
    shutil.rmtree(home, ignore_errors=True)


@pytest.fixture(scope="session")
def postgres(servers_home: Path) -> Iterator[EmbeddedServer | GivenServer]:
    """The run's Postgres, with a migrated template database. Not to be killed: see `short_home`."""
    given = given_server("MAREY_TEST_POSTGRES")
    with start_postgres(servers_home, durable=False) if given is None else nullcontext(given) as server:
        _execute(server, f"DROP DATABASE IF EXISTS {TEMPLATE} WITH (FORCE)")
        _execute(server, f"CREATE DATABASE {TEMPLATE}")
        engine = create_engine(_url(server, TEMPLATE))
        upgrade(engine)
        engine.dispose()
        yield server


@pytest.fixture
def database_url(postgres: EmbeddedServer | GivenServer) -> Iterator[str]:
    """URL of a migrated, empty database of this test's own."""
    name = f"test_{next(_numbers)}"
    _execute(postgres, f"CREATE DATABASE {name} {COPY}")
    yield _url(postgres, name)
    _execute(postgres, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture(scope="module")
def module_database_url(postgres: EmbeddedServer | GivenServer) -> Iterator[str]:
    """URL of a migrated, empty database that the tests of a module share."""
    name = f"module_{next(_numbers)}"
    _execute(postgres, f"CREATE DATABASE {name} {COPY}")
    yield _url(postgres, name)
    _execute(postgres, f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture
def engine(database_url: str) -> Iterator[sa.Engine]:
    """Engine of `database_url`."""
    engine = create_engine(database_url, pool_size=10, max_overflow=20)
    yield engine
    engine.dispose()


@pytest.fixture(scope="session")
def valkey(servers_home: Path) -> Iterator[EmbeddedServer | GivenServer]:
    """The run's Valkey. Not to be killed: see `short_home`."""
    given = given_server("MAREY_TEST_REDIS")
    with start_valkey(servers_home) if given is None else nullcontext(given) as server:
        yield server


@pytest.fixture
def queue_url(valkey: EmbeddedServer | GivenServer) -> str:
    """Celery's URL of an empty Valkey."""
    with redis_client(valkey.url) as client:
        client.flushall()
    return valkey.url


@pytest.fixture
def folder_store(tmp_path: Path) -> FolderStore:
    """An empty asset store in a folder."""
    return FolderStore(tmp_path / "assets")


@pytest.fixture(scope="session")
def swift(servers_home: Path) -> Iterator[Swift]:
    """The run's S3 server. Who stops it starts it again."""
    folder = servers_home / "swift"
    folder.mkdir()
    server = Swift(folder)
    server.start()
    yield server
    server.stop()


@pytest.fixture
def s3_store(swift: Swift) -> S3Store:
    """An empty asset store on S3."""
    return swift.new_store()


def _url(server: EmbeddedServer | GivenServer, database: str) -> str:
    return sa.make_url(server.url).set(database=database).render_as_string(hide_password=False)


def _execute(server: EmbeddedServer | GivenServer, statement: str) -> None:
    dsn = sa.make_url(server.url).set(drivername="postgresql", database="postgres")
    with psycopg.connect(dsn.render_as_string(hide_password=False), autocommit=True) as connection:
        connection.execute(statement.encode())


@pytest.fixture
def models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of models, in which this process finds bundles and imported text encoders."""
    from marey.core.settings import settings as process_settings

    monkeypatch.setattr(process_settings(), "models", tmp_path / "bundles")
    monkeypatch.setattr(process_settings(), "home", tmp_path / "home")
    return tmp_path / "bundles"
