"""Jobs and items: tables, state machine, repositories. The only SQL of the product.

Functions take a `sqlalchemy.Connection` inside a transaction and never commit; `transaction(engine)` gives one and
turns outages into `Unreachable`. Everything is synchronous: an event loop runs it in threads.

    engine = create_engine(url)
    with transaction(engine) as conn:
        job = submit(conn, NewJob(items))
"""

from shared.jobs.claim import claim, heartbeat, load_texts, waiting_batches, waiting_items
from shared.jobs.database import (
    EVENT_CHANNEL,
    QUEUE_CHANNEL,
    Listener,
    Notification,
    create_engine,
    transaction,
)
from shared.jobs.errors import IdempotencyMismatch
from shared.jobs.gc import asset_key, collect_garbage, remove_stale_assets
from shared.jobs.keys import SCOPES, authenticate, create_key, list_keys, revoke_key
from shared.jobs.listings import events_after, get_job, get_motion, list_items, list_jobs, list_motions
from shared.jobs.migrate import check_revision, downgrade, upgrade
from shared.jobs.operate import cancel, delete, pause, resume, retry, set_comment, set_priority
from shared.jobs.policy import Policy, policy
from shared.jobs.results import begin_assets, commit_motions, commit_texts, fail_items, release
from shared.jobs.states import ItemState, JobControl, JobState, Stage
from shared.jobs.submit import submit
from shared.jobs.sweep import sweep
from shared.jobs.types import (
    DEFAULT_TENANT,
    SEED_LIMIT,
    TEXT_QUEUE,
    ApiKey,
    AssetDigest,
    Claim,
    ClaimedItem,
    Committed,
    EventRow,
    GarbageReport,
    Heartbeat,
    ItemFailure,
    ItemRow,
    JobRow,
    MotionFile,
    MotionRow,
    NewApiKey,
    NewItem,
    NewJob,
    NewMotion,
    NewText,
    Page,
    Problem,
    SubmittedJob,
    SweepReport,
    WorkerBeat,
    WorkerRow,
)
from shared.jobs.workers import beat, list_workers, live_workers, retire

__all__ = [
    "DEFAULT_TENANT",
    "EVENT_CHANNEL",
    "QUEUE_CHANNEL",
    "SCOPES",
    "SEED_LIMIT",
    "TEXT_QUEUE",
    "ApiKey",
    "AssetDigest",
    "Claim",
    "ClaimedItem",
    "Committed",
    "EventRow",
    "GarbageReport",
    "Heartbeat",
    "IdempotencyMismatch",
    "ItemFailure",
    "ItemRow",
    "ItemState",
    "JobControl",
    "JobRow",
    "JobState",
    "Listener",
    "MotionFile",
    "MotionRow",
    "NewApiKey",
    "NewItem",
    "NewJob",
    "NewMotion",
    "NewText",
    "Notification",
    "Page",
    "Policy",
    "Problem",
    "Stage",
    "SubmittedJob",
    "SweepReport",
    "WorkerBeat",
    "WorkerRow",
    "asset_key",
    "authenticate",
    "beat",
    "begin_assets",
    "cancel",
    "check_revision",
    "claim",
    "collect_garbage",
    "commit_motions",
    "commit_texts",
    "create_engine",
    "create_key",
    "delete",
    "downgrade",
    "events_after",
    "fail_items",
    "get_job",
    "get_motion",
    "heartbeat",
    "list_items",
    "list_jobs",
    "list_keys",
    "list_motions",
    "list_workers",
    "live_workers",
    "load_texts",
    "pause",
    "policy",
    "release",
    "remove_stale_assets",
    "resume",
    "retire",
    "retry",
    "revoke_key",
    "set_comment",
    "set_priority",
    "submit",
    "sweep",
    "transaction",
    "upgrade",
    "waiting_batches",
    "waiting_items",
]
