"""All metrics of the product; a process exposes those of its part. The operations guide explains each.

Labels have few values: queues, states, stages, parts, routes. Only the number of tenants grows with use;
`MAX_TENANTS` of them have series of their own. No label is an id of a job, an item or a key.
"""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector


def _part() -> CollectorRegistry:
    """Return the registry of one kind of process and the common one. Unset gauges are not exported as 0."""
    registry = CollectorRegistry()
    registry.register(COMMON)
    return registry


COMMON = CollectorRegistry()
ProcessCollector(registry=COMMON)  # memory, CPU time, open files
API, WORKER, LIVE, SCHEDULER = _part(), _part(), _part(), _part()
PARTS = {"api": API, "worker": WORKER, "live": LIVE, "scheduler": SCHEDULER}

MAX_TENANTS = 50
"""Tenants with series of their own, those with the most waiting items; the rest is summed up."""
OTHER_TENANTS = "(other)"
"""Label of the summed-up tenants: parentheses are not allowed in a tenant's name."""

FAST = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 120.0)
"""Seconds: from a claim to the run of a large batch on a slow machine."""

# --- the API: requests ---

HTTP_REQUESTS = Counter("marey_http_requests", "Answered requests.", ("method", "route", "status"), registry=API)
HTTP_SECONDS = Histogram("marey_http_seconds", "Time to the end of an answer.", ("method", "route"), registry=API)
SOCKETS = Gauge("marey_open_sockets", "Clients that watch a live stream.", registry=API)
EVENT_STREAMS = Gauge("marey_open_event_streams", "Clients that follow a job.", registry=API)
MADE_FILES = Counter(
    "marey_made_files",
    "Files made on request: made, refused (the motion cannot be written like this) or failed.",
    ("format", "outcome"),
    registry=API,
)

# --- the API: database figures, read at each scrape ---

QUEUE = ("queue", "tenant")
WAITING = Gauge("marey_waiting_items", "Ready items of running jobs.", QUEUE, registry=API)
RUNNING = Gauge("marey_running_items", "Items under a lease.", QUEUE, registry=API)
OLDEST = Gauge("marey_oldest_waiting_seconds", "Age of the oldest ready item.", QUEUE, registry=API)
UNSERVED = Gauge("marey_unserved_seconds", "Longest time that ready items waited for any claim.", QUEUE, registry=API)
WORKERS = Gauge("marey_live_workers", "Live workers, by queue.", ("queue",), registry=API)
SCHEDULERS = Gauge(
    "marey_scheduler_silent_seconds",
    "Time since the last progress of all parts of a scheduler, by host.",
    ("host",),
    registry=API,
)
STREAMS = Gauge("marey_streams", "Open live streams, by state.", ("state",), registry=API)
WEBHOOKS_PENDING = Gauge("marey_webhooks_pending", "Pending webhook deliveries.", registry=API)
WEBHOOKS_OVERDUE = Gauge(
    "marey_webhooks_overdue_seconds", "Seconds by which the next delivery is overdue.", registry=API
)
CANCELLED = Counter("marey_cancelled_items", "Items cancelled by operators.", registry=API)

# --- workers ---

BATCH_ITEMS = Histogram(
    "marey_batch_items", "Items of a claim.", ("queue",), buckets=(1, 2, 4, 8, 16, 32, 64), registry=WORKER
)
STAGE_SECONDS = Histogram(
    "marey_stage_seconds",
    "Time of a stage of a batch: claim, load, run (a bucket), export (an item), store, commit.",
    ("queue", "stage"),
    buckets=FAST,
    registry=WORKER,
)
ITEMS = Counter(
    "marey_items",
    "Items processed by workers, by new state: ready ones are retried.",
    ("queue", "state"),
    registry=WORKER,
)
THROWN_AWAY = Counter(
    "marey_results_thrown_away", "Discarded results: lease lost or cancelled.", ("queue",), registry=WORKER
)
OUTAGES = Counter("marey_outages", "Times a worker released items uncounted.", ("queue",), registry=WORKER)
GPU_MEMORY = Gauge(
    "marey_gpu_memory_bytes",
    "Memory of the device: allocated and reserved by this worker, free and total of all.",
    ("device", "kind"),
    registry=WORKER,
)
LIVE.register(GPU_MEMORY)

# --- live workers ---

LIVE_STREAMS = Gauge("marey_live_streams", "Streams of this worker.", registry=LIVE)
LIVE_FRAMES = Counter("marey_live_frames", "Frames written to Redis.", registry=LIVE)
LIVE_TICK_SECONDS = Histogram(
    "marey_live_tick_seconds",
    "Time to make one frame of every stream.",
    buckets=(0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.075, 0.1, 0.2, 0.5, 1.0),
    registry=LIVE,
)
LIVE_LATE = Counter("marey_live_late", "Times the frame clock was reset: too slow.", registry=LIVE)
LIVE_LOST = Counter("marey_live_leases_lost", "Streams lost to another worker.", registry=LIVE)

# --- the scheduler ---

ROUNDS = Counter(
    "marey_scheduler_rounds",
    "Rounds of a part of the scheduler: done, waiting (something is away) or failed.",
    ("part", "outcome"),
    registry=SCHEDULER,
)
HINTS = Counter("marey_hints", "Hints sent by the relay, by queue.", ("queue",), registry=SCHEDULER)
LEASES_LOST = Counter("marey_leases_lost", "Expired leases reclaimed from silent workers.", registry=SCHEDULER)
SWEPT = Counter(
    "marey_swept_items",
    "Items of lost leases, by new state: ready or dead.",
    ("state",),
    registry=SCHEDULER,
)
WEBHOOKS = Counter(
    "marey_webhook_tries", "Webhook delivery attempts: delivered, retried or failed.", ("outcome",), registry=SCHEDULER
)
WEBHOOK_SECONDS = Histogram("marey_webhook_seconds", "Duration of an attempt.", registry=SCHEDULER)

# --- all processes ---

STORE_ERRORS = Counter(
    "marey_store_errors", "Times the asset store could not be used, by kind: folder or s3.", ("store",), registry=COMMON
)
