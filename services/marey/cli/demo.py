"""`make demo`: twelve prompts through the whole platform, into `out/demo`."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from marey.cli import console
from marey.cli.children import ends_with_parent, marey
from marey.cli.watching import watch_job
from marey.client.health import is_healthy
from marey.client.manifest import flags_of
from marey.client.server_address import find_server
from marey.core.errors import MareyError, NotFound, TimedOut, Unreachable

if TYPE_CHECKING:
    from marey.bundles import Bundle

OUT = Path("out/demo")
INTERRUPTED = 130
START_SECONDS = 120.0
"""Time to create the database, import torch and load the model: 15 s, longer with a slow disk."""
JOB_SECONDS = 240.0
CANDIDATES = 4
"""Motions that are drawn of each prompt, where the model can; the best is kept."""
PROMPTS = (
    {"prompt": "a person walks forward", "name": "walk", "seconds": 4, "seed": 1},
    {"prompt": "someone runs forward in a hurry", "name": "run", "seconds": 3, "seed": 2},
    {"prompt": "a person walks backward", "name": "backward", "seconds": 4, "seed": 3},
    {"prompt": "a man turns around", "name": "turn-around", "seconds": 3, "seed": 4},
    {"prompt": "someone waves with the right hand", "name": "wave-right", "seconds": 4, "seed": 5},
    {"prompt": "a man raises both hands", "name": "raise-both", "seconds": 4, "seed": 6},
    {"prompt": "a person bows deeply", "name": "bow", "seconds": 4, "seed": 7},
    {"prompt": "a woman sits down on a chair", "name": "sit-down", "seconds": 4, "seed": 8},
    {"prompt": "a fighter kicks", "name": "kick", "seconds": 3, "seed": 10},
    {"prompt": "a man climbs a ladder", "name": "ladder", "seconds": 4, "seed": 12},
    {"prompt": "she drinks from a cup", "name": "drink", "seconds": 3, "seed": 15},
    {"prompt": "someone does a cartwheel", "name": "cartwheel", "seconds": 3, "seed": 16},
)


def main() -> int:
    """Run the demo and return the exit code."""
    began = time.monotonic()
    home = OUT.absolute() / ".home"
    try:
        shutil.rmtree(OUT, ignore_errors=True)  # every run begins anew
        OUT.mkdir(parents=True, exist_ok=True)
        bundle = _ensure_bundle(home)
        with _server(home):
            lines = _run(bundle)
        _draw(lines)
        shutil.rmtree(home)  # after a failure it stays, with its logs
        _show(lines, random=bundle.manifest.random)
    except MareyError as error:
        console.say(f"make demo: {error}")
        return error.exit_code
    except KeyboardInterrupt:
        console.say("make demo: interrupted")
        return INTERRUPTED
    failed = sum(line["state"] != "succeeded" for line in lines)
    console.say(f"{len(lines) - failed} motions (.bvh, .npz, .png) in {OUT}/ after {time.monotonic() - began:.0f} s.")
    console.say("Open a .bvh in Blender (File, Import, Motion Capture), or a .png in any viewer.")
    return 6 if failed else 0


def _ensure_bundle(home: Path) -> Bundle:
    """Return the bundle of the default model; make one with random weights if there is none."""
    os.environ["MAREY_HOME"] = str(home)
    from marey.bundles import choose_bundle
    from marey.cli.roles.generating import make_random_bundle
    from marey.core.settings import settings

    model = settings().default_model
    try:
        return choose_bundle(model, verify=False)
    except NotFound:
        console.say("There is no trained bundle in models/: making a tiny one with random weights.")
        make_random_bundle(model, home / "models" / f"{model}-random")
        return choose_bundle(model, verify=False)


@contextlib.contextmanager
def _server(home: Path) -> Iterator[None]:
    """Run `marey serve` on a free port as a child until the end of the block."""
    for name in ("MAREY_SERVER", "MAREY_DATABASE_URL", "MAREY_QUEUE_URL", "MAREY_STORE"):
        os.environ.pop(name, None)
    home.mkdir(mode=0o700, parents=True, exist_ok=True)
    (home / "server.json").unlink(missing_ok=True)
    log = home / "serve.log"
    log.touch(mode=0o600)
    # An interrupt can come before `Popen` has returned: then no one here could end the server.
    command = ends_with_parent(marey("serve", "--port", "0"))
    with log.open("wb") as output, subprocess.Popen(command, stdout=output, stderr=output) as process:
        try:
            _wait_until_ready(process, log)
            yield
        finally:
            process.terminate()


def _wait_until_ready(process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_SECONDS
    with console.stderr().status("starting the server"):
        while time.monotonic() < deadline:
            if process.poll() is not None:
                raise Unreachable(f"the server ended: {log.read_text()[-2000:]}", where=str(log))
            if _is_ready():
                return
            time.sleep(0.2)
    raise TimedOut("the server is not ready", where=str(log), hint=f"Look into the logs beside {log}.")


def _is_ready() -> bool:
    try:
        return is_healthy(f"{find_server().url}/readyz", timeout=5)
    except Unreachable:
        return False


def _run(bundle: Bundle) -> list[dict[str, Any]]:
    from marey.cli.commands.fetch import fetch_job
    from marey.client import Client
    from marey.registry import get_model

    candidates = {"settings": {"best_of": CANDIDATES}} if get_model(bundle.manifest.model).best_of else {}
    with Client() as client:
        job = client.jobs.submit([prompt | candidates for prompt in PROMPTS], name="demo")
        watch_job(client, job.id, timeout=JOB_SECONDS)
        return fetch_job(client, job.id, OUT, template="{name}", overwrite=True)


def _draw(lines: list[dict[str, Any]]) -> None:
    """Draw a contact sheet beside each npz."""
    from marey.motion.clip import load_npz
    from marey.viz.render import contact_sheet

    with console.bar() as bar:
        for line in bar.track(lines, description="drawing"):
            if "npz" in line["files"]:
                npz = Path(line["files"]["npz"])
                contact_sheet(load_npz(npz), npz.with_suffix(".png"))


def _show(lines: list[dict[str, Any]], *, random: bool) -> None:
    from rich.table import Table

    title = f"{lines[0]['bundle']}, {lines[0]['licence']}"
    if random:
        title = f"RANDOM WEIGHTS ({title}): these motions show the machinery, not the prompts"
    table = Table(title=title, title_justify="left")
    for column in ("prompt", "state", "length", "quality", "files"):
        table.add_column(column, no_wrap=column not in {"prompt", "quality"})
    for line in lines:
        length = f"{line['frames'] / line['fps']:.1f} s" if line["frames"] else ""
        files = f"{line['name']}.*" if line["files"] else ""
        table.add_row(line["prompt"], line["state"], length, flags_of(line), files)
    console.drawing(sys.stdout).print(table)


if __name__ == "__main__":
    sys.exit(main())
