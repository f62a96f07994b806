"""The services of `docker-compose.yml` as processes, each with its exact command, variables, secrets and check."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest
import redis
import sqlalchemy as sa

from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.db import create_engine, transaction
from marey.embedded import EmbeddedServer
from marey.registry import model_names
from tests.servers.swift import ACCESS_KEY, SECRET_KEY, Swift
from tests.support.compose import services, waits_for
from tests.support.composed import Network, Process, free_ports, write_secrets
from tests.support.marey import Marey

pytestmark = pytest.mark.slow

EVALUATED = "prompt,seconds,expected\n" + "".join(f"a person walks {n} steps,1.5,walk\n" for n in range(1, 33))


@dataclass(frozen=True)
class Stack:
    """All services, healthy, and a client of another machine."""

    processes: dict[str, Process]
    client: Marey


@pytest.fixture(scope="module")
def stack(
    module_database_url: str, valkey: EmbeddedServer, swift: Swift, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Stack]:
    folder = tmp_path_factory.mktemp("composed")
    _empty(module_database_url, valkey)
    network = Network(folder, free_ports(2), swift.endpoint)
    own = {"database_url": module_database_url, "queue_url": valkey.url}
    write_secrets(network.secrets, own | {"s3_access_key": ACCESS_KEY, "s3_secret_key": SECRET_KEY})
    processes = {name: Process(service, network) for name, service in services().items() if service.ours}
    try:
        migrate = processes["migrate"]
        assert migrate.start().wait() == 0, migrate.log.read_text()
        lasting = [process for name, process in processes.items() if name != "migrate"]
        assert all("migrate" in waits_for(each.service) for each in lasting if each.service.name != "parser")
        for process in lasting:
            process.start()
        for process in lasting:
            process.wait_until_healthy()
        key = processes["api"].run("admin", "keys", "create", "studio", "--scope", "submit", "--scope", "read").strip()
        server = {"MAREY_SERVER": f"http://127.0.0.1:{network.api}", "MAREY_KEY": key.split()[-1]}
        yield Stack(processes, Marey(folder / "elsewhere", folder / "none", server))
    finally:
        for process in processes.values():
            process.kill()


def _empty(database_url: str, valkey: EmbeddedServer) -> None:
    engine = create_engine(database_url)
    with transaction(engine) as conn:
        conn.execute(sa.text("DROP SCHEMA public CASCADE"))
        conn.execute(sa.text("CREATE SCHEMA public"))
    engine.dispose()
    with redis.Redis(unix_socket_path=valkey.url.removeprefix("redis+socket://")) as client:
        client.flushall()


def test_prompts_become_motions_of_every_model(stack: Stack, tmp_path: Path) -> None:
    for model in model_names():
        out = tmp_path / model
        stack.client("submit", "a person walks", "--model", model, "--seconds", 2, "--fetch", out, timeout=300).ok()
        assert {path.suffix for path in out.iterdir()} >= {".bvh", ".npz"}


def test_the_parser_parses_for_the_api(stack: Stack) -> None:
    server = Server(stack.client.environment["MAREY_SERVER"], stack.client.environment["MAREY_KEY"])
    with Transport(server) as client:
        parsed = client.post("/v1/texts/parse", {"prompts": ["a person walks"]})
    assert parsed["items"][0]["text"] == "a person walks"


def test_an_evaluation_ends_in_a_report(stack: Stack, tmp_path: Path) -> None:
    prompts = tmp_path / "studio.csv"
    prompts.write_text(EVALUATED)
    ran = stack.client("eval", "run", "--bundle", "hgm3-starter", "--split", prompts, "--wait", timeout=600).ok()
    stack.client("eval", "report", ran.out.split()[0], "-o", tmp_path / "report.json").ok()
    assert json.loads((tmp_path / "report.json").read_text())["motions"] == 32


def test_whoever_has_a_port_for_metrics_tells_them(stack: Stack) -> None:
    first = {"scheduler": "marey_scheduler_rounds_total", "worker": "marey_items_total"}
    for process in stack.processes.values():
        if process.metrics:
            told = _get(process.metrics)
            assert first.get(process.service.name, "marey_batch_items") in told
    assert "marey_live_streams" in _get(stack.processes["worker"].metrics + 1)


def _get(port: int) -> str:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30) as answer:
        return answer.read().decode()


def test_everyone_ends_well_within_its_grace_period(stack: Stack) -> None:
    lasting = {name: process for name, process in stack.processes.items() if name != "migrate"}
    with ThreadPoolExecutor(len(lasting)) as pool:  # Compose stops all at once
        codes = dict(zip(lasting, pool.map(Process.stop, lasting.values()), strict=True))
    assert codes == dict.fromkeys(lasting, 0)
    assert not any(process.healthy() for process in lasting.values())
