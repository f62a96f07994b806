"""Jobs and their items: states, submission, claims, leases, results.

Functions take a `sqlalchemy.Connection` inside a transaction and never commit; `marey.db.transaction(engine)` opens
one and converts outages to `Unreachable`. Everything is synchronous: an event loop runs it in threads.

    engine = create_engine(url)
    with transaction(engine) as conn:
        job = submit(conn, NewJob(items))
"""

from marey.jobs.claim import claim, heartbeat, leased_items, load_texts, waiting_batches, waiting_items
from marey.jobs.errors import IdempotencyMismatch
from marey.jobs.estimate_types import Estimate, QueuePlace, Speed
from marey.jobs.estimates import estimate, place_of
from marey.jobs.figures import (
    Outbox,
    QueueDepth,
    database_now,
    open_stream_counts,
    outbox_state,
    overdue_leases,
    queue_depths,
    server_version,
)
from marey.jobs.files import asset_key
from marey.jobs.lease_types import (
    AssetDigest,
    Claim,
    ClaimedItem,
    Committed,
    HeartbeatReply,
    ItemFailure,
    NewMotion,
    NewText,
    SchedulerRow,
    SweepReport,
    WorkerHeartbeat,
    WorkerRow,
)
from marey.jobs.listings import events_after, get_job, list_items, list_jobs
from marey.jobs.motions import find_motions, get_motion, missing_motion, motions_of
from marey.jobs.operate import cancel, pause, resume, retry, set_comment, set_fail_early, set_priority
from marey.jobs.policy import Policy, policy
from marey.jobs.results import begin_assets, commit_motions, commit_texts, fail_items, release
from marey.jobs.states import ItemStage, ItemState, JobControl, JobKind, JobState, Review
from marey.jobs.submit import find_submitted, submit
from marey.jobs.sweep import make_due, sweep
from marey.jobs.types import (
    EDIT_QUEUE,
    EVALUATOR_QUEUE,
    MAX_KEEP_DAYS,
    NO_TEXT,
    PRIORITY_LIMIT,
    SEED_LIMIT,
    TEXT_QUEUE,
    Edits,
    EventRow,
    FailureReason,
    ItemRow,
    JobRow,
    MotionFile,
    MotionRow,
    NewItem,
    NewJob,
    SubmittedJob,
)
from marey.jobs.workers import beat, list_schedulers, list_workers, live_workers, record_scheduler_heartbeat, retire

__all__ = [
    "EDIT_QUEUE",
    "EVALUATOR_QUEUE",
    "MAX_KEEP_DAYS",
    "NO_TEXT",
    "PRIORITY_LIMIT",
    "SEED_LIMIT",
    "TEXT_QUEUE",
    "AssetDigest",
    "Claim",
    "ClaimedItem",
    "Committed",
    "Edits",
    "Estimate",
    "EventRow",
    "FailureReason",
    "HeartbeatReply",
    "IdempotencyMismatch",
    "ItemFailure",
    "ItemRow",
    "ItemStage",
    "ItemState",
    "JobControl",
    "JobKind",
    "JobRow",
    "JobState",
    "MotionFile",
    "MotionRow",
    "NewItem",
    "NewJob",
    "NewMotion",
    "NewText",
    "Outbox",
    "Policy",
    "QueueDepth",
    "QueuePlace",
    "Review",
    "SchedulerRow",
    "Speed",
    "SubmittedJob",
    "SweepReport",
    "WorkerHeartbeat",
    "WorkerRow",
    "asset_key",
    "beat",
    "begin_assets",
    "cancel",
    "claim",
    "commit_motions",
    "commit_texts",
    "database_now",
    "estimate",
    "events_after",
    "fail_items",
    "find_motions",
    "find_submitted",
    "get_job",
    "get_motion",
    "heartbeat",
    "leased_items",
    "list_items",
    "list_jobs",
    "list_schedulers",
    "list_workers",
    "live_workers",
    "load_texts",
    "make_due",
    "missing_motion",
    "motions_of",
    "open_stream_counts",
    "outbox_state",
    "overdue_leases",
    "pause",
    "place_of",
    "policy",
    "queue_depths",
    "record_scheduler_heartbeat",
    "release",
    "resume",
    "retire",
    "retry",
    "server_version",
    "set_comment",
    "set_fail_early",
    "set_priority",
    "submit",
    "sweep",
    "waiting_batches",
    "waiting_items",
]
