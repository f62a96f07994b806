"""`marey serve`, `worker`, `scheduler`, `api`: the processes of a server; and `probe`, which checks them."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Annotated, Literal

import typer

from marey.core.errors import InvalidInput
from marey.core.garbage import no_collection
from marey.core.private_home import UMASK


def serve(
    roles: Annotated[
        str | None,
        typer.Option(
            "--with",
            help="Workers: + joins queues in one child, a comma separates children. "
            "None given = --workers children for prompts and every model that has a bundle here, the first for "
            "evaluations as well; one for edits.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            min=1,
            max=64,
            help="Children that read prompts and generate. Default: one for each core, at most 4, and one for each "
            "2 GiB of memory; one on a GPU.",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int | None, typer.Option("--port", min=0, max=65535, help="Port of the API; 0 = any that is free.")
    ] = None,
    host: Annotated[str | None, typer.Option("--host", help="Address to listen on.")] = None,
) -> None:
    """Run all services on this machine, with a database and queue of their own, until Ctrl-C."""
    os.umask(UMASK)
    from marey.cli.ports import try_port
    from marey.cli.roles.serving import default_roles, default_workers, parse_roles
    from marey.core.extras import extra

    with extra("worker"), no_collection():
        from marey.cli.supervisor import Supervisor
        from marey.core.settings import Settings, settings
    if roles is not None and workers is not None:
        raise InvalidInput("is given beside --with, which names all children", where="--workers", hint="Drop one.")
    changes: dict[str, object] = {}
    if host is not None:
        changes["host"] = host
    if port is not None:
        changes["port"] = port or try_port(host or settings().host, 0)
    config: Settings = settings().model_copy(update=changes)
    roles = roles or default_roles(config, workers or default_workers(config.device))
    Supervisor(config, parse_roles(roles)).run()


def worker(
    model: Annotated[
        str | None,
        typer.Argument(
            metavar="MODEL",
            help="Queues: a model such as hgm3, text, edit, evaluator; or several, as hgm3+text. models = every model "
            "that has a bundle here. Default: MAREY_ROLE.",
            show_default=False,
        ),
    ] = None,
    only: Annotated[
        Literal["queue", "live"] | None,
        typer.Option(
            "--only", help="A model that streams has two processes, its queue and its live streams: one of them."
        ),
    ] = None,
) -> None:
    """Run one worker; MAREY_DATABASE_URL and MAREY_QUEUE_URL name the database and the queue."""
    os.umask(UMASK)
    from marey.cli.roles.serving import expand, live_models, parse_roles, role_of
    from marey.core.extras import extra

    with extra("worker"), no_collection():
        from marey.core.settings import settings
        from marey.runtime.worker import worker_main
    where = "MODEL" if model else "MAREY_ROLE"
    model = model or settings().role
    if not model:
        raise InvalidInput(
            "a worker needs to know what it serves", where=where, hint="Name its queues: `marey worker hgm3`."
        )
    model = expand(model.replace(",", "+"), settings())
    queues = parse_roles(model, where)[0]
    shown = live_models(queues)
    if only == "live":
        from marey.runtime.live.main import live_main

        if len(shown) != 1:
            raise InvalidInput(
                f"{model!r} names {len(shown)} models that stream", where="MODEL", hint="Name one that does."
            )
        (factory,) = shown.values()
        raise typer.Exit(live_main(factory, settings()))
    role = role_of(queues, settings())
    if only == "queue" or not shown or not settings().live_slots:
        raise typer.Exit(worker_main(role, settings()))
    _keep_queue_and_streams(model, shown)


def _keep_queue_and_streams(model: str, streaming: Iterable[str]) -> None:
    """Run one process for the queues of `model`, and one for the live streams of each streaming model."""
    from marey.cli.children import SupervisedProcess, keep_all, marey, metrics_port
    from marey.core.settings import settings

    parts = [(f"{model} queue", [model, "--only", "queue"])]
    parts += [(f"{name} live", [name, "--only", "live"]) for name in streaming]
    keep_all(
        [
            SupervisedProcess(title, marey("worker", *words), {**os.environ, **metrics_port(settings(), place)})
            for place, (title, words) in enumerate(parts)
        ]
    )


def scheduler() -> None:
    """Run relay, sweeper, evaluations and schedules; several schedulers can run at once."""
    os.umask(UMASK)
    from marey.core.extras import extra

    with extra("server"), no_collection():
        from marey.core.settings import settings
        from marey.scheduler.main import scheduler_main
    raise typer.Exit(scheduler_main(settings()))


def api() -> None:
    """Run the HTTP API alone; MAREY_HOST and MAREY_PORT set its address."""
    os.umask(UMASK)
    from marey.core.extras import extra

    with extra("server"), no_collection():
        from marey.api.app import serve as serve_api
    serve_api()


def probe(
    health: Annotated[
        Literal["live", "ready"], typer.Argument(help="live = none is stuck; ready = their models are loaded as well.")
    ] = "live",
) -> None:
    """Check the workers and schedulers of this machine; exit 4 if one is unhealthy. For health checks of containers."""
    from marey.core.extras import extra

    with extra("server"), no_collection():
        from marey.core.settings import settings
        from marey.runtime.status import check_health
    check_health(settings().home, ready=health == "ready")
