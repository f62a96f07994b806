"""User actions on motions: search, reviews and re-rolls, references, retention, erasure, garbage collection."""

from marey.takes.gc import collect_garbage, remove_stale_assets, remove_unused_assets
from marey.takes.listings import list_motions
from marey.takes.references import ReferenceKind, ReferenceMatch, resolve_reference
from marey.takes.retention import delete, delete_expired, erase, rewrite_files
from marey.takes.reviews import MAX_REVIEWED, reroll, review
from marey.takes.types import Erasure, GarbageReport, MotionFilter, Reroll

__all__ = [
    "MAX_REVIEWED",
    "Erasure",
    "GarbageReport",
    "MotionFilter",
    "ReferenceKind",
    "ReferenceMatch",
    "Reroll",
    "collect_garbage",
    "delete",
    "delete_expired",
    "erase",
    "list_motions",
    "remove_stale_assets",
    "remove_unused_assets",
    "reroll",
    "resolve_reference",
    "review",
    "rewrite_files",
]
