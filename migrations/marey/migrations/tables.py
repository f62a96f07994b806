"""The tables of all packages, on the one metadata that they share."""

from __future__ import annotations

from marey.db.tables import metadata
from marey.evaluations import tables as evaluations
from marey.jobs import tables as jobs
from marey.streams import tables as streams
from marey.tenants import tables as tenants
from marey.webhooks import tables as webhooks

__all__ = ["evaluations", "jobs", "metadata", "streams", "tenants", "webhooks"]
