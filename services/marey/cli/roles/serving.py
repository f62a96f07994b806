"""The workers that `marey serve` and `marey worker` start."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from marey.core.cores import cores
from marey.core.errors import InvalidInput
from marey.registry import get_model, model_names

if TYPE_CHECKING:
    from marey.core.settings import Settings
    from marey.runtime.handler import Role

TEXT = "text"
"""The queue of prompts."""
EDIT = "edit"
"""The queue of edits of stored motions."""
WITHOUT_DEVICE = frozenset({TEXT, EDIT})
"""Queues that compute on no device."""
MOST_WORKERS = 4
"""Children that generate by default: more gain little beside database, queue and API."""
WORKER_MEMORY = 2 << 30
"""Bytes of the machine's memory for each of them; one takes 0.5 to 0.7 GiB with the bundles of the checkout."""
NVIDIA = Path("/dev/nvidia0")
"""The first GPU on Linux: a process without torch cannot ask CUDA."""
EVERY_MODEL = "models"
"""In the queues of a worker: every model that has a bundle here."""
PLATFORM = {
    TEXT: "marey.text_service.handler:create_handler",
    EDIT: "marey.editing.handler:create_handler",
    "evaluator": "marey.evaluator.handler:create_handler",
}
"""Factories of the queues that are no model's, as strings: only a worker's child imports them, and torch with most."""


def known_queues() -> tuple[str, ...]:
    """Return the queues that a worker can serve: of every registered model, and of the platform."""
    return (*model_names(), *PLATFORM)


def live_models(queues: Iterable[str]) -> dict[str, str]:
    """Return the models among these queues that stream, each with the factory of its live loop."""
    specs = (get_model(queue) for queue in dict.fromkeys(queues) if queue not in PLATFORM)
    return {spec.name: spec.live for spec in specs if spec.live is not None}


def default_roles(config: Settings, workers: int) -> str:
    """Return the roles of the children of a server.

    Each of `workers` children serves every model with a bundle here, and prompts; the first, evaluations as well if
    there is an evaluator. One more serves edits, which take milliseconds and wait for no batch.
    """
    from marey.bundles import list_bundles

    queues = "+".join([*models_here(config), TEXT])
    judges = ["evaluator" for _ in list_bundles(config=config, kind="evaluator")][:1]
    return ",".join(["+".join([queues, *judges]), *[queues] * (workers - 1), EDIT])


def default_workers(device: str) -> int:
    """Return how many children generate unless the user says it: one for each core, within the machine's memory.

    A second child makes a list of prompts in two thirds of the time on two cores: batches leave cores idle while
    prompts are read and files written. Children on a GPU would only wait for each other.
    """
    if device.startswith("cuda") or (device == "auto" and NVIDIA.exists()):
        return 1
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return max(1, min(cores(), MOST_WORKERS, memory // WORKER_MEMORY))


def models_here(config: Settings) -> list[str]:
    """The models that have a bundle here; the default model where none has."""
    from marey.bundles import list_bundles

    here = {bundle.manifest.model for bundle in list_bundles(config=config, kind="generator")}
    return [model for model in model_names() if model in here] or [config.default_model]


def expand(queues: str, config: Settings) -> str:
    """Queues with the word `models` replaced by every model that has a bundle here."""
    parts = queues.split("+")
    return "+".join("+".join(models_here(config)) if part.strip() == EVERY_MODEL else part for part in parts)


def parse_roles(text: str, where: str = "--with") -> list[tuple[str, ...]]:
    """`hgm3+text,hgm3` → one worker of both queues and one of the first.

    Args:
        text: queues; + joins them in one child, a comma separates children.
        where: where it was given, for the error.

    Raises:
        InvalidInput: an unknown queue.
    """
    roles = [tuple(part.strip() for part in role.split("+")) for role in text.split(",")]
    known = known_queues()
    for name in (name for role in roles for name in role):
        if name not in known:
            raise InvalidInput(
                f"there is no worker {name!r}",
                where=where,
                hint=f"Known: {', '.join(known)}; + joins them in one child, a comma separates children.",
            )
    return roles


def role_of(queues: Sequence[str], config: Settings) -> Role:
    """Return the role of a worker that serves these queues and loads its model before it is ready.

    Raises:
        NotFound, InvalidBundle: there is no bundle for its model, or a broken one.
    """
    from marey.bundles import choose_bundle
    from marey.runtime.handler import Role

    preload = {q: choose_bundle(q, config=config).reference for q in queues if q not in PLATFORM}
    return Role("+".join(queues), {q: PLATFORM.get(q) or get_model(q).handler for q in queues}, preload)


def check_device(device: str, roles: Sequence[Sequence[str]]) -> None:
    """Check that the workers of these roles can compute on the device, in a child process: this one has no torch.

    Raises:
        InvalidInput: there is no such device.
    """
    if not device.startswith("cuda") or all(queue in WITHOUT_DEVICE for role in roles for queue in role):
        return
    asked = subprocess.run(
        [sys.executable, "-m", "marey.nn.devices", device], capture_output=True, text=True, check=False
    )
    if asked.returncode != 0:
        said = (asked.stderr.strip().splitlines() or ["it cannot be used"])[-1]
        raise InvalidInput(f"is {device}: {said}", where="MAREY_DEVICE", hint="Set it to cpu or auto.")


def threads_of(config: Settings, torch_children: int) -> int:
    """Return the torch threads of one child: the cores, divided by the children that compute."""
    return config.threads or max(1, cores() // max(1, torch_children))
