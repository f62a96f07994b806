"""Jobs for tests: items without a network behind them, and a worker's steps on real rows."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from uuid import UUID

import sqlalchemy as sa

from marey.db import transaction
from marey.jobs import (
    AssetDigest,
    Claim,
    FailureReason,
    NewItem,
    NewJob,
    NewMotion,
    NewText,
    begin_assets,
    claim,
    commit_motions,
    commit_texts,
    submit,
)
from marey.tenants import Quotas, create_tenant

MODEL = "hgm3"
PROBLEM = FailureReason("test", "it does not work", hint="Try another.")


def new_item(index: int, prompt: str | None = None, **changes: object) -> NewItem:
    """An item with made-up keys that follow its prompt and bundle."""
    text = f"walk {index}" if prompt is None else prompt
    bundle = str(changes.get("bundle", "tiny@0"))
    values: dict[str, object] = {
        "index": index,
        "prompt": text,
        "model": MODEL,
        "bundle": bundle,
        "batch_key": f"batch of {bundle}",
        "text_key": hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest(),
        "text_batch_key": "light",
        "seed": index,
        "settings": {"steps": 10},
    }
    return NewItem(**(values | changes))  # pyright: ignore[reportArgumentType]


def submit_items(engine: sa.Engine, items: int | Iterable[NewItem], **job: object) -> UUID:
    """Submit so many items, or these."""
    chosen = map(new_item, range(items)) if isinstance(items, int) else items
    with transaction(engine) as conn:
        return submit(conn, NewJob(chosen, **job)).id  # pyright: ignore[reportArgumentType]


def new_tenant(engine: sa.Engine, name: str = "studio", **quotas: int) -> str:
    """A tenant with these quotas; its name."""
    with transaction(engine) as conn:
        create_tenant(conn, name, Quotas(**quotas))
    return name


def claim_some(engine: sa.Engine, queue: str = MODEL, limit: int = 32, worker: str = "w", **more: object) -> Claim:
    """A claim that must succeed."""
    with transaction(engine) as conn:
        found = claim(conn, queue, worker, limit, **more)  # pyright: ignore[reportArgumentType]
    assert found is not None, f"nothing to claim in {queue}"
    return found


def parse_texts(engine: sa.Engine) -> None:
    """Run the text stage until nothing of it is left."""
    while True:
        with transaction(engine) as conn:
            found = claim(conn, "text", "text worker", 64)
            if found is None:
                return
            texts = [NewText(item.id, item.text_key, item.prompt.encode()) for item in found.items]
            commit_texts(conn, found.lease_token, texts)


def motion_of(item: UUID, content: bytes | None = None) -> NewMotion:
    """A finished motion with one npz of this content."""
    data = str(item).encode() if content is None else content
    digest = AssetDigest(hashlib.sha256(data).hexdigest(), len(data), "application/x-npz")
    return NewMotion(item, {"npz": digest}, frames=40, fps=20.0, licence="CC0-1.0", elapsed=0.5)


def commit_all(engine: sa.Engine, found: Claim, items: Sequence[UUID] | None = None) -> list[UUID]:
    """Announce and commit motions of a claim (nothing is PUT); the items that were written."""
    motions = [motion_of(item) for item in items or [item.id for item in found.items]]
    with transaction(engine) as conn:
        begin_assets(conn, found.lease_token, [file for motion in motions for file in motion.files.values()])
    with transaction(engine) as conn:
        return list(commit_motions(conn, found.lease_token, motions).items)


def let_expire(engine: sa.Engine, lease_token: UUID) -> None:
    """Time passes for a lease: as if its worker had been silent for longer than it lasts."""
    with transaction(engine) as conn:
        conn.execute(
            sa.text("UPDATE lease SET expires_at = now() - interval '1 second' WHERE token = :token"),
            {"token": lease_token},
        )


def make_due(engine: sa.Engine) -> None:
    """Time passes for items that wait for another try."""
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE item SET run_after = now() WHERE run_after IS NOT NULL"))
