"""Access to Postgres: connections with deadlines, transactions, notifications, migrations, pages of listings."""

from marey.db.database import EVENT_CHANNEL, QUEUE_CHANNEL, create_engine, outages, transaction
from marey.db.deadlines import BACKUP, BULK, HEARTBEAT, MAINTENANCE, SEARCH, Deadline
from marey.db.listener import Listener, Notification, check_listening
from marey.db.migrate import check_revision, downgrade, upgrade
from marey.db.pages import Page

__all__ = [
    "BACKUP",
    "BULK",
    "EVENT_CHANNEL",
    "HEARTBEAT",
    "MAINTENANCE",
    "QUEUE_CHANNEL",
    "SEARCH",
    "Deadline",
    "Listener",
    "Notification",
    "Page",
    "check_listening",
    "check_revision",
    "create_engine",
    "downgrade",
    "outages",
    "transaction",
    "upgrade",
]
