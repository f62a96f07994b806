"""Checks of `marey doctor`. They are independent: a failure of one hides no other."""

from __future__ import annotations

import contextlib
import importlib.util
import platform
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

from marey.cli.doctor_findings import Finding, broken, free_space
from marey.core.cores import cores
from marey.core.errors import MareyError
from marey.core.private_home import FOLDER_MODE, is_open

if TYPE_CHECKING:
    from marey.bundles import Bundle
    from marey.client.server_address import Server
    from marey.core.settings import Settings

ANSWER_SECONDS, LIVE_SECONDS = 10.0, 5.0
"""Deadlines of a server's answers: a listing takes milliseconds, and a missed deadline of the database 5 s."""


def check_all() -> Iterator[Finding]:
    """Run every check, in the order in which problems are best solved."""
    old = sys.version_info < (3, 11)
    yield Finding("python", "bad" if old else "ok", platform.python_version(), "Install Python 3.11." if old else None)
    yield _extra("motion", "numpy", "convert, render")
    yield _extra("server", "fastapi", "serve, api, scheduler")
    yield _extra("worker", "torch", "generate, worker, train")
    yield _home()
    yield _server()
    if _installed("pydantic_settings"):
        from marey.core.settings import settings

        try:
            settings()
        except MareyError as error:
            yield broken("settings", error)
            return  # all that follows needs them
    if _installed("fastapi"):
        from marey.cli.doctor_servers import check_backing

        yield from check_backing()
    if _installed("pydantic_settings") and _installed("safetensors"):
        from marey.core.settings import settings

        yield from models(settings())
        if _installed("torch"):
            yield from device(settings())


def _installed(package: str) -> bool:
    return importlib.util.find_spec(package) is not None


def _extra(name: str, package: str, commands: str) -> Finding:
    if _installed(package):
        return Finding(f"marey[{name}]", "ok", commands)
    hint = f"pip install 'marey[{name}]', if this machine is to run {commands}."
    return Finding(f"marey[{name}]", "warn", "not installed; a client needs no server's packages", hint)


def _home() -> Finding:
    from marey.client.fetching import check_folder
    from marey.client.server_address import home

    folder = home()
    with contextlib.suppress(OSError):  # the check reports the reason
        folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
    try:
        check_folder(folder, hint="Make it writable for this user, or set MAREY_HOME to another folder.")
    except MareyError as error:
        return broken("home", error)
    if is_open(folder):
        hint = f"Run `chmod 700 {folder}`; `marey serve` closes it, with what is in it, when it starts."
        return Finding("home", "warn", f"{folder} is open to other users", hint)
    return free_space("home", folder)


def _server() -> Finding:
    from marey.client import Client
    from marey.client.foreign_answers import NoAnswer
    from marey.client.server_address import find_server
    from marey.core.errors import Unreachable

    try:
        server = find_server()
    except Unreachable as error:
        return Finding("server", "warn", error.message, error.hint)
    except MareyError as error:
        return broken("server", error)
    try:
        with Client(server, timeout=ANSWER_SECONDS, attempts=2) as client:
            next(client.jobs.list(limit=1), None)
    except MareyError as error:
        return (_stalled(server) if isinstance(error, NoAnswer) else None) or broken("server", error)
    return Finding("server", "ok", server.url)


def _stalled(server: Server) -> Finding | None:
    """Name the part that stalls of a server that accepts connections and does not answer; None for another error."""
    from marey.client.foreign_answers import NoAnswer
    from marey.client.health import OK, health_status
    from marey.core.errors import Unreachable

    hint = "See its log, then restart it; `marey serve` and other supervisors restart what exits, not what hangs."
    try:
        status = health_status(f"{server.url}/livez", timeout=LIVE_SECONDS)
    except NoAnswer:
        message = f"{server.url} accepts connections, but answers nothing within {LIVE_SECONDS:g} s: it stalls"
        return Finding("server", "bad", message, hint)
    except Unreachable:
        return None
    if status != OK:
        return None
    message = f"{server.url} answers /livez, but not /v1/jobs within {ANSWER_SECONDS:g} s: it stalls, or its database"
    return Finding("server", "bad", message, f"See the checks of the database on the server's machine. {hint}")


def models(config: Settings) -> Iterator[Finding]:
    """Check every bundle of this machine: its files, and the encoder and labeller of its prompts."""
    from marey.bundles import find_bundle, scan_bundles
    from marey.bundles.limits import seconds_of
    from marey.bundles.places import STARTER

    bundles = scan_bundles(config=config)
    for left_out in bundles.broken:
        yield broken("models", left_out.error)
    if not bundles.found and not bundles.broken:
        hint = f"`pip install {STARTER}`, or put one into the folder that MAREY_MODELS names."
        yield Finding("models", "warn", "no bundle here", hint)
    for found in bundles.found:
        try:
            bundle = find_bundle(found.path.name, config=config)
            if bundle.manifest.kind == "generator":
                seconds_of(bundle)
        except MareyError as error:
            yield broken("models", error)
            continue
        yield Finding("models", "ok", f"{bundle.reference}, {bundle.manifest.licence}, every hash right")
        if bundle.manifest.text is not None and _installed("torch"):
            yield _reads(bundle, config)


def _reads(bundle: Bundle, config: Settings) -> Finding:
    """Check that the encoder and labeller that a bundle was trained with are installed."""
    from marey.bundles import find_bundle
    from marey.text.encoders import encoder_sha256
    from marey.text.keys import NO_LABELLER, labeller_bundle

    spec, name = bundle.manifest.text, "text"
    assert spec is not None  # the caller looked
    try:
        if spec.encoder_sha256 not in (None, encoder_sha256(spec.encoder, config=config)):
            message = f"{bundle.manifest.name} was trained with other weights of {spec.encoder!r} than those installed"
            hint = "Restore the weights it names, or train the bundle anew: docs/how-to/training.md."
            return Finding(name, "bad", message, hint)
        if spec.labeller != NO_LABELLER:
            labeller = find_bundle(labeller_bundle(spec.labeller), config=config)
            if spec.labeller_sha256 not in (None, labeller.weights_sha256):
                message = f"{bundle.manifest.name} was trained with another {spec.labeller!r} than {labeller.reference}"
                return Finding(name, "bad", message, "Restore that labeller's bundle.")
    except MareyError as error:
        return broken(name, error)
    return Finding(name, "ok", f"{bundle.manifest.name} reads by {spec.encoder} and {spec.labeller}, the right weights")


def device(config: Settings) -> Iterator[Finding]:
    """Check the processor and the GPU."""
    import torch

    able = torch.backends.cpu.get_cpu_capability()
    slow = able in ("DEFAULT", "NO AVX")
    hint = "Expect several times the time: this build of torch or this processor has no vector instructions."
    message = f"torch {torch.__version__}, {cores()} cores, {able}"
    yield Finding("cpu", "warn" if slow else "ok", message, hint if slow else None)
    wanted = config.device
    if not torch.cuda.is_available():
        if wanted.startswith("cuda"):
            hint = "Install a CUDA build of torch and the driver, or set MAREY_DEVICE=cpu."
            yield Finding("gpu", "bad", f"MAREY_DEVICE is {wanted}, and torch finds no GPU", hint)
        else:
            yield Finding("gpu", "ok", "none; motions are made by the processor")
        return
    for index in range(torch.cuda.device_count()):
        free, total = torch.cuda.mem_get_info(index)
        name = torch.cuda.get_device_name(index)
        yield Finding("gpu", "ok", f"cuda:{index}, {name}, {free / 2**30:.1f} of {total / 2**30:.1f} GiB free")
