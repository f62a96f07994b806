"""What `marey doctor` looks at."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from shared.errors import MareyError

SMALLEST_FREE = 2 * 2**30
"""Bytes: Postgres stops at a full disk, and 1,000 motions take 200 MB."""


@dataclass(frozen=True)
class Check:
    """One finding. `missing` is no fault: a client needs no server's packages."""

    name: str
    state: Literal["ok", "missing", "broken"]
    message: str


def check_all() -> Iterator[Check]:
    """Every check, each on its own: a broken one hides no other."""
    yield Check("python", "ok" if sys.version_info >= (3, 11) else "broken", platform.python_version())
    yield _extra("motion", "numpy", "convert, render")
    yield _extra("server", "fastapi", "serve, api, scheduler")
    yield _extra("worker", "torch", "generate, worker, train")
    yield _home()
    yield _server()
    yield from _models()


def _extra(name: str, package: str, commands: str) -> Check:
    if importlib.util.find_spec(package) is not None:
        return Check(f"marey[{name}]", "ok", commands)
    return Check(f"marey[{name}]", "missing", f"pip install 'marey[{name}]' for {commands}")


def _home() -> Check:
    from services.cli.fetching import check_folder
    from services.cli.place import home

    folder = home()
    try:
        check_folder(folder)
    except MareyError as error:
        return Check("home", "broken", str(error))
    free = shutil.disk_usage(folder).free
    state = "ok" if free > SMALLEST_FREE else "broken"
    return Check("home", state, f"{folder}, {free / 2**30:.1f} GiB free")


def _server() -> Check:
    from services.cli.client import Client
    from services.cli.place import find_server
    from shared.errors import Unreachable

    try:
        server = find_server()
    except Unreachable as error:
        return Check("server", "missing", f"{error.message}. {error.hint}")
    except MareyError as error:
        return Check("server", "broken", str(error))
    try:
        with Client(server) as client:
            client.get("/v1/jobs", limit=1)
    except MareyError as error:
        return Check("server", "broken", str(error))
    return Check("server", "ok", server.url)


def _models() -> Iterator[Check]:
    if importlib.util.find_spec("pydantic_settings") is None:
        return
    from shared.bundles import find_bundle, list_bundles

    try:
        names = [bundle.manifest.name for bundle in list_bundles()]
    except MareyError as error:
        yield Check("models", "broken", str(error))
        return
    if not names:
        yield Check("models", "missing", "no bundle here; MAREY_MODELS names their folder")
    for name in names:
        try:
            bundle = find_bundle(name)
        except MareyError as error:
            yield Check("models", "broken", str(error))
        else:
            yield Check("models", "ok", f"{bundle.reference}, {bundle.manifest.licence}, every hash right")
