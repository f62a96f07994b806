import subprocess
import sys

import pytest

from marey.runtime.app import DRAIN, TIME_LIMIT, VISIBILITY_TIMEOUT, create_app
from marey.runtime.queue import redis_client


def test_a_message_is_never_restored_while_its_task_may_still_run() -> None:
    conf = create_app("redis://localhost").conf
    assert conf.broker_transport_options["visibility_timeout"] == VISIBILITY_TIMEOUT > 2 * TIME_LIMIT
    assert conf.visibility_timeout == conf.result_backend_transport_options["visibility_timeout"] == VISIBILITY_TIMEOUT


def test_a_dead_child_gives_its_hint_back_and_nothing_is_prefetched_behind_a_long_one() -> None:
    conf = create_app("redis://localhost").conf
    assert conf.task_acks_late
    assert conf.task_reject_on_worker_lost
    assert conf.worker_disable_prefetch
    assert conf.worker_prefetch_multiplier == 0
    assert conf.worker_pool_start_method == "spawn"
    assert conf.worker_concurrency == 1


@pytest.mark.parametrize("url", ["redis://localhost:1/0", "redis+socket:///tmp/nowhere.sock"])
def test_every_client_has_timeouts(url: str) -> None:
    options = redis_client(url).connection_pool.connection_kwargs
    assert options["socket_timeout"]
    assert options["socket_connect_timeout"]
    assert options["health_check_interval"]
    # redis-py raises TypeError for keepalive on a Unix socket.
    redis_client(url).connection_pool.make_connection()
    channel = create_app(url).connection_for_write().channel
    assert channel is not None


def test_the_task_has_the_name_the_relay_publishes() -> None:
    import marey.runtime.tasks as tasks

    app = create_app("redis://localhost")
    app.loader.import_default_modules()
    assert tasks.drain.name == DRAIN in app.tasks


def test_a_worker_parent_imports_no_torch() -> None:
    code = "import sys; import marey.runtime.worker, marey.runtime.tasks; sys.exit('torch' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_scheduler_imports_neither_torch_nor_workers() -> None:
    code = (
        "import sys; import marey.scheduler.main; "
        "files = [getattr(module, '__file__', None) or '' for module in list(sys.modules.values())]; "
        "sys.exit('torch' in sys.modules or any('/workers/marey/' in file for file in files))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
