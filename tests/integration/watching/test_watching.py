"""One job through real processes, and all that is to be seen of it: its trace, its log lines, its numbers."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx2
import pytest
import sqlalchemy as sa
from prometheus_client.parser import text_string_to_metric_families

from marey.core import tracing
from marey.db import transaction
from marey.jobs.tables import item, job, motion
from tests.chaos.driver import Cluster
from tests.servers.collector import Collector, Spanned
from tests.servers.ports import free_ports
from tests.support.live_api import BUNDLE, LiveApi, running_api, settings_of
from tests.support.marey import Marey, Ran
from tests.support.toy import REFERENCE, TEXT_REFERENCE

SECRET = "moonwalk"
"""A word of every prompt, and of nothing else."""
PROMPTS = [f"walk the {SECRET} number {number}" for number in range(3)] + [f"refuse the {SECRET}"]
WORKER, SCHEDULER = "WORKER", "SCHEDULER"


class Numbers:
    """An exposition, read by Prometheus' own parser."""

    def __init__(self, text: str) -> None:
        self._samples = {
            (sample.name, frozenset(sample.labels.items())): sample.value
            for family in text_string_to_metric_families(text)
            for sample in family.samples
        }

    def __call__(self, name: str, **labels: str) -> float:
        """One number; KeyError where it is not told."""
        return self._samples[name, frozenset(labels.items())]

    def has_number(self, name: str, **labels: str) -> bool:
        """Return True if the number exists."""
        return (name, frozenset(labels.items())) in self._samples

    @property
    def names(self) -> set[str]:
        """Of all samples."""
        return {name for name, _ in self._samples}


@dataclass(frozen=True)
class Seen:
    """A job that has ended, and where to look."""

    ran: Ran
    job: str
    cluster: Cluster
    collector: Collector
    api: LiveApi
    ports: dict[str, int]

    def log(self, name: str) -> list[dict[str, object]]:
        """The log of a process."""
        lines = (self.cluster.home / f"{name}.log").read_text().splitlines()
        return [json.loads(line) for line in lines if line.startswith("{")]  # the pool writes some of its own

    def numbers(self, name: str) -> Numbers:
        """Prometheus metrics of a process."""
        return Numbers(httpx2.get(f"http://127.0.0.1:{self.ports[name]}/metrics").text)


@pytest.fixture(scope="module")
def seen() -> Iterator[Seen]:
    """One job from the command line, through API, scheduler and worker; three motions, and one item that is refused."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    with pytest.MonkeyPatch.context() as patch, Collector() as collector:
        environment = collector.environment()
        ports = dict(zip((WORKER, SCHEDULER), free_ports(2), strict=True))
        with Cluster(home, {"MAREY_STORE": str(home / "assets"), **environment}) as cluster:
            cluster.start_scheduler(MAREY_METRICS_PORT=str(ports[SCHEDULER]))
            cluster.start_worker(
                "worker",
                queue="hgm3,text",
                reference=f"{REFERENCE},{TEXT_REFERENCE}",
                MAREY_METRICS_PORT=str(ports[WORKER]),
            )
            for name, value in environment.items():
                patch.setenv(name, value)
            config = settings_of(home, cluster.postgres.url, cluster.valkey.url)
            tracing.configure_tracing("api")
            try:
                with running_api(config, cluster.postgres.url) as api:
                    own = {"MAREY_SERVER": api.url, "MAREY_KEY": api.key, **environment}
                    marey = Marey(home / "client", config.models, own)
                    ran = marey("submit", *PROMPTS, "--bundle", BUNDLE, "--watch")
                    yield Seen(ran, ran.out.strip(), cluster, collector, api, ports)
            finally:
                tracing.end_tracing()


def test_a_trace_leads_from_the_command_to_each_motion_row(seen: Seen) -> None:
    assert seen.ran.code == 6, seen.ran.err  # one item failed
    with transaction(seen.api.engine) as conn:
        made = {str(row) for row in conn.execute(sa.select(motion.c.item_id)).scalars()}
        stored = conn.execute(sa.select(job.c.traceparent)).scalar_one()
    assert len(made) == 3
    seen.cluster.wait(lambda: made <= written(seen.collector.spans()), "the commits arrive")
    seen.cluster.wait(lambda: "marey-cli" in {span.service for span in seen.collector.spans()}, "the command arrives")
    seen.cluster.wait(lambda: batches_ended(seen.collector.spans()), "the batches arrive")
    spans = {span.id: span for span in seen.collector.spans()}
    commits = [span for span in spans.values() if span.attributes.get("marey.what") == "motions"]
    assert {name for span in commits for name in span.items} >= made
    for commit in commits:
        path = path_to_root(commit, spans)
        assert [(step.service, step.name) for step in path] == [
            ("marey-worker-toy", "commit"),
            ("marey-worker-toy", "hgm3 batch"),
            ("marey-api", "POST /v1/jobs"),
            ("marey-cli", "POST /v1/jobs"),
            ("marey-cli", "marey submit"),
        ]
        assert {step.trace for step in path} == {tracing.trace_id(stored)}
        assert tracing.trace_id(stored) in stored
        assert path[2].id in stored  # the row holds the context of the request that wrote it
    ours = {span.name for span in spans.values() if span.trace == tracing.trace_id(stored)}
    assert ours >= {"submit", "text batch", "hgm3 batch", "claim", "load", "run", "export", "store", "commit"}
    root = next(span for span in spans.values() if span.name == "marey submit")
    assert root.failed  # its exit code was 6


def test_every_line_about_work_names_its_job_lease_and_trace_and_no_line_a_prompt(seen: Seen) -> None:
    with transaction(seen.api.engine) as conn:
        rows = conn.execute(sa.select(item.c.id, item.c.state)).all()
        trace = tracing.trace_id(conn.execute(sa.select(job.c.traceparent)).scalar_one())
    lines = [line for line in seen.log("worker") if "lease" in line]
    assert {line["event"] for line in lines} >= {"claimed", "committed", "item_not_made"}
    assert {(line["job"], line["trace"]) for line in lines} == {(seen.job, trace)}
    claims = [line for line in lines if line["event"] == "claimed"]
    assert {line["queue"] for line in claims} == {"text", "hgm3"}
    assert {name for line in claims for name in line["item_ids"]} == {str(row.id) for row in rows}  # pyright: ignore
    (refused,) = [line for line in lines if line["event"] == "item_not_made"]
    assert (refused["item"], refused["state"]) == (str(next(r.id for r in rows if r.state == "failed")), "failed")
    for path in seen.cluster.home.glob("*.log"):
        text = path.read_text()
        assert SECRET not in text, path.name
        assert seen.api.key not in text, path.name
    assert SECRET.encode() not in seen.collector.raw()


def test_a_worker_counts_each_item_once_with_its_batches_and_stages(seen: Seen) -> None:
    committed = {"queue": "hgm3", "stage": "commit"}  # counted behind the commit that the command has seen
    seen.cluster.wait(
        lambda: seen.numbers(WORKER).has_number("marey_stage_seconds_count", **committed),
        "the worker counts its commit",
    )
    numbers = seen.numbers(WORKER)
    assert numbers("marey_items_total", queue="text", state="parsed") == 4
    assert numbers("marey_items_total", queue="hgm3", state="succeeded") == 3
    assert numbers("marey_items_total", queue="hgm3", state="failed") == 1
    assert numbers("marey_batch_items_sum", queue="hgm3") == 4
    assert numbers("marey_stage_seconds_count", queue="hgm3", stage="export") == 3
    for stage in ("claim", "load", "run", "store", "commit"):
        assert numbers("marey_stage_seconds_count", queue="hgm3", stage=stage) >= 1
    assert "marey_leases_lost_total" not in numbers.names  # a worker shows a worker's numbers


def test_the_scheduler_counts_its_rounds_and_hints(seen: Seen) -> None:
    parts = ("relay", "sweeper", "evaluations")

    def all_went_round() -> bool:
        numbers = seen.numbers(SCHEDULER)
        return all(numbers.has_number("marey_scheduler_rounds_total", part=part, outcome="done") for part in parts)

    seen.cluster.wait(all_went_round, "every part goes round once")
    numbers = seen.numbers(SCHEDULER)
    for part in parts:
        assert numbers("marey_scheduler_rounds_total", part=part, outcome="done") >= 1
    assert numbers("marey_hints_total", queue="hgm3") >= 1
    assert numbers("marey_leases_lost_total") == 0


def test_numbers_are_told_on_loopback_alone(seen: Seen) -> None:
    listening = {
        address.rpartition(":")[0]
        for address in local_addresses()
        if address.rpartition(":")[2] == f"{seen.ports[WORKER]:04X}"
    }
    assert listening == {"0100007F"}


def test_the_api_tells_of_queues_and_workers_and_nothing_of_what_workers_do(seen: Seen) -> None:
    with seen.api.http("metrics") as http:
        numbers = Numbers(http.get("/metrics").text)
    assert numbers("marey_live_workers", queue="hgm3") == 1
    assert "marey_items_total" not in numbers.names  # those are the workers'


def written(spans: list[Spanned]) -> set[str]:
    """Items whose commit has arrived."""
    return {name for span in spans if span.attributes.get("marey.what") == "motions" for name in span.items}


def batches_ended(spans: list[Spanned]) -> bool:
    """Return True if the parents of all commits have arrived."""
    known = {span.id for span in spans}
    return all(span.parent in known for span in spans if span.name in ("commit", "hgm3 batch", "POST /v1/jobs"))


def path_to_root(span: Spanned, spans: dict[str, Spanned]) -> list[Spanned]:
    """A span and those it belongs to."""
    path = [span]
    while path[-1].parent:
        path.append(spans[path[-1].parent])
    return path


def local_addresses() -> list[str]:
    """Addresses that TCP sockets of this machine listen at, as the kernel writes them."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return [row[1] for row in rows if row[3] == "0A"]
