"""The tables, a module for each room. `migrations/` makes them; a test compares the two.

The rows of `job` and `lane` change with every claim and commit. No index names what changes in them, and their pages
are half empty, so that Postgres cleans up behind each update by itself (heap-only tuples) and a claim costs the same
after thousands of others. Lanes of jobs that have ended are deleted.

Lock order, so that nothing deadlocks: schedule row, evaluation row, job row, lease row, item rows, lane rows, asset
rows, tenant row. Who holds a job's lock may change everything about that job; the heartbeat takes a lease row alone.
Under the tenant's lock claims and submits count what there is of a quota, one after the other.
"""

from marey.jobs.schema.base import metadata
from marey.jobs.schema.evaluations import evaluation, evaluation_event, evaluation_report, prompt_set, schedule
from marey.jobs.schema.jobs import JOB_STATE, idempotency, item, job, job_event, lane, lease, text_features, worker
from marey.jobs.schema.motions import asset, asset_writer, motion, motion_file, motion_search
from marey.jobs.schema.streams import stream, stream_chunk
from marey.jobs.schema.tenants import api_key, audit_event, tenant
from marey.jobs.schema.webhooks import webhook, webhook_attempt, webhook_delivery, webhook_event

__all__ = [
    "JOB_STATE",
    "api_key",
    "asset",
    "asset_writer",
    "audit_event",
    "evaluation",
    "evaluation_event",
    "evaluation_report",
    "idempotency",
    "item",
    "job",
    "job_event",
    "lane",
    "lease",
    "metadata",
    "motion",
    "motion_file",
    "motion_search",
    "prompt_set",
    "schedule",
    "stream",
    "stream_chunk",
    "tenant",
    "text_features",
    "webhook",
    "webhook_attempt",
    "webhook_delivery",
    "webhook_event",
    "worker",
]
