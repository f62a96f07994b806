"""User actions on motions: search, edits, reviews and re-rolls, references, retention, erasure, rigs, files
made on request, garbage collection."""

from marey.takes.edits import NewEdit, check_edit, revert, submit_edit
from marey.takes.gc import collect_garbage, remove_assets, remove_stale_assets, remove_unused_assets
from marey.takes.listings import list_motions
from marey.takes.made import (
    MadeFile,
    MakingClaim,
    claim_making,
    fail_making,
    find_made,
    keep_made,
    release_makings,
    remove_expired_makings,
    renew_makings,
)
from marey.takes.model_edits import EditGenerator, needs_model
from marey.takes.references import ReferenceKind, ReferenceMatch, resolve_reference
from marey.takes.retention import delete, delete_expired, erase, rewrite_files
from marey.takes.reviews import MAX_REVIEWED, reroll, review
from marey.takes.rig_backups import RigRecord, back_up_rigs, restore_rig
from marey.takes.rigs import add_rig, get_rig, list_rigs, remove_rig
from marey.takes.types import AddedRig, Erasure, GarbageReport, MotionFilter, NewRig, Reroll, RigRow

__all__ = [
    "MAX_REVIEWED",
    "AddedRig",
    "EditGenerator",
    "Erasure",
    "GarbageReport",
    "MadeFile",
    "MakingClaim",
    "MotionFilter",
    "NewEdit",
    "NewRig",
    "ReferenceKind",
    "ReferenceMatch",
    "Reroll",
    "RigRecord",
    "RigRow",
    "add_rig",
    "back_up_rigs",
    "check_edit",
    "claim_making",
    "collect_garbage",
    "delete",
    "delete_expired",
    "erase",
    "fail_making",
    "find_made",
    "get_rig",
    "keep_made",
    "list_motions",
    "list_rigs",
    "needs_model",
    "release_makings",
    "remove_assets",
    "remove_expired_makings",
    "remove_rig",
    "remove_stale_assets",
    "remove_unused_assets",
    "renew_makings",
    "reroll",
    "resolve_reference",
    "restore_rig",
    "revert",
    "review",
    "rewrite_files",
    "submit_edit",
]
