"""A process of the product for the driver: `api`, `scheduler`, or `worker NAME QUEUE REFERENCE BUNDLE`; with commas, a
worker of several queues.

It is what `marey scheduler` and `marey worker` call, with a toy in place of a model; it dies with the test.
"""

from __future__ import annotations

import sys

from marey.core.garbage import end_without_collection, no_collection

with no_collection():
    from celery.platforms import set_pdeathsig

    from marey.core.settings import settings
    from marey.runtime.handler import Role
    from marey.runtime.worker import worker_main
    from marey.scheduler.main import scheduler_main


def main(what: str, *arguments: str) -> int:
    """Run until told to stop."""
    set_pdeathsig("SIGKILL")
    if what == "api":
        from marey.api.app import serve  # a worker does without

        serve()
        return 0
    if what == "scheduler":
        return scheduler_main(settings())
    name, queue, reference, bundle = arguments
    handlers = dict(zip(queue.split(","), reference.split(","), strict=True))
    role = Role("toy", handlers, {queue: bundle} if bundle else {})
    return worker_main(role, settings(), name=name)


if __name__ == "__main__":
    end_without_collection()
    sys.exit(main(*sys.argv[1:]))
