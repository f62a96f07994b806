"""Files made on request: found, claimed, made in child processes, kept; one `FileMaker` per API process."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any, TypeVar
from uuid import UUID

import sqlalchemy as sa
import structlog
from anyio import to_thread

from marey.api.making.processes import MakingProcesses
from marey.core.errors import Conflict, InvalidFile, InvalidInput, MareyError, TooLarge, Unreachable
from marey.core.metrics import MADE_FILES
from marey.core.settings import Settings
from marey.db import transaction
from marey.exporters import exporter_of
from marey.exporters.making import FileRecipe
from marey.http.slots import SlotCounter, SlotLimits
from marey.jobs import FailureReason, asset_key
from marey.jobs.types import MotionFile
from marey.storage import AssetStore
from marey.takes import (
    MadeFile,
    MakingClaim,
    RigRow,
    claim_making,
    fail_making,
    find_made,
    keep_made,
    release_makings,
    renew_makings,
)
from marey.tenants import ApiKey

WAIT_SECONDS = 5.0
"""Seconds that a request waits for its file."""
LOOK_SECONDS = 0.2
"""Seconds between looks at a file that another request or process makes."""
RENEW_SECONDS = 4.0
SLOTS = SlotLimits(total=64, tenant=32, key=16)
"""Files that one API process makes, or that wait in it for their turn."""
ERRORS = {kind.problem_type: kind for kind in (InvalidInput, InvalidFile, TooLarge, Conflict)}

Found = TypeVar("Found")
log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class FileOrder:
    """A file that a request asks for.

    Attributes:
        source: sha256 of the npz that it is made of.
        rig: the tenant's rig that it is made on, or has the proportions of; None = none, or one of Marey's.
    """

    key: ApiKey
    motion: UUID
    source: str
    recipe: FileRecipe
    rig: RigRow | None = None

    @property
    def identity(self) -> str:
        """Key of the file (`FileRecipe.key`)."""
        return self.recipe.key(self.source)


class FileMaker:
    """Makes files beside the event loop, each once: its row is claimed first, and other processes see that."""

    def __init__(self, config: Settings, engine: sa.Engine, store: AssetStore) -> None:
        self._quota = config.made_files_bytes
        self._engine = engine
        self._store = store
        self._processes = MakingProcesses()
        self._slots = SlotCounter("requests for files", SLOTS)
        self._making: dict[MakingClaim, asyncio.Task[None]] = {}
        self._renewing: asyncio.Task[None] | None = None

    async def get(self, order: FileOrder) -> MotionFile | None:
        """Return a file, made if it is not there; None if that takes longer than `WAIT_SECONDS`: it goes on.

        Raises:
            InvalidInput, TooLarge, Conflict: the motion cannot be written like this.
            Busy: too many files are waiting.
            Unreachable: the store or the database does not answer.
        """
        loop = asyncio.get_running_loop()
        until = loop.time() + WAIT_SECONDS
        while True:
            made = await self._look(order)
            if made is not None and made.file is not None:
                return made.file
            if made is not None and made.problem is not None:
                raise _error(made.problem)
            task = None if made is not None else await self._start(order)
            left = until - loop.time()
            if left <= 0:
                return None
            if task is None:
                await asyncio.sleep(min(LOOK_SECONDS, left))
            elif (await asyncio.wait([task], timeout=left))[0]:
                task.result()

    async def report(self, key: ApiKey, name: str, format: str, rig_map: Any, data: bytes) -> dict[str, Any]:
        """Return what is found in the file of a rig (`marey.motion.rigs.report.describe`).

        Args:
            name: of the rig.
            format: ending of the file's name.
            rig_map: JSON value of the map of its joints; None = no map.

        Raises:
            InvalidInput, InvalidFile, TooLarge: the file cannot be read, or motion cannot be put on it.
            Busy: too many files are waiting.
        """
        with self._slots.take(key):
            found = await self._processes.report(name, format, rig_map, data)
        if isinstance(found, FailureReason):
            raise _error(found)
        return found

    async def poses(self, key: ApiKey, frames: Sequence[int], npz: bytes, where: str) -> list[dict[str, Any]]:
        """Return frames of a motion as fields of pose keyframes (`marey.motion.keyframes.pose_of`).

        Args:
            npz: the motion.
            where: its name in errors.

        Raises:
            InvalidInput, Conflict, TooLarge: the npz cannot be read, or has no such frame.
            Busy: too many files are waiting.
        """
        with self._slots.take(key):
            found = await self._processes.poses(frames, npz, where)
        if isinstance(found, FailureReason):
            raise _error(found)
        return found

    async def close(self) -> None:
        """Stop: files in the making are left to the next request."""
        if self._renewing is not None:
            self._renewing.cancel()
        tasks = dict(self._making)
        for task in tasks.values():
            task.cancel()
        await _in_thread(self._processes.close)
        await asyncio.gather(*tasks.values(), return_exceptions=True)
        with suppress(Unreachable):  # then they expire
            await _in_thread(lambda: release_makings(self._engine, [claim.token for claim in tasks]))

    async def _look(self, order: FileOrder) -> MadeFile | None:
        def look() -> MadeFile | None:
            with transaction(self._engine) as conn:
                return find_made(conn, order.motion, order.identity)

        return await _in_thread(look)

    async def _start(self, order: FileOrder) -> asyncio.Task[None] | None:
        """Claim a file and begin to make it; None if another request or process was faster."""

        def claim() -> MakingClaim | None:
            with transaction(self._engine) as conn:
                format = order.recipe.format
                return claim_making(
                    conn,
                    order.key.tenant,
                    order.motion,
                    source=order.source,
                    key=order.identity,
                    format=format,
                    rig=order.rig,
                )

        stack = ExitStack()
        stack.enter_context(self._slots.take(order.key))  # refused before anything is written
        try:
            claimed = await _in_thread(claim)
        except BaseException:
            stack.close()
            raise
        if claimed is None:
            stack.close()
            return None
        task = asyncio.create_task(self._hold(order, claimed, stack))
        self._making[claimed] = task
        task.add_done_callback(lambda _: self._forget(claimed))
        if self._renewing is None or self._renewing.done():
            self._renewing = asyncio.create_task(self._renew())
        return task

    def _forget(self, claim: MakingClaim) -> None:
        task = self._making.pop(claim)
        if not task.cancelled():
            task.exception()  # asyncio complains about errors that no request waits for any more

    async def _hold(self, order: FileOrder, claim: MakingClaim, slot: ExitStack) -> None:
        """Make a file; give up the claim if that fails otherwise than by the file's fault."""
        with slot:
            try:
                await self._make(order, claim)
            except Exception as error:
                MADE_FILES.labels(claim.format, "failed").inc()
                log.warning("making_failed", error=str(error), exc_info=not isinstance(error, MareyError))
                with suppress(Unreachable):
                    await _in_thread(lambda: release_makings(self._engine, [claim.token]))
                raise

    async def _make(self, order: FileOrder, claim: MakingClaim) -> None:
        npz = await _in_thread(lambda: self._store.get(asset_key(claim.tenant, claim.source)))
        rig = b""
        if (file := order.recipe.rig) is not None:
            rig = await _in_thread(lambda: self._store.get(asset_key(claim.tenant, file.sha256)))
        made = await self._processes.make(order.recipe, npz, f"motion {claim.motion}", rig)
        if isinstance(made, FailureReason):
            problem = made
            await _in_thread(lambda: fail_making(self._engine, claim, problem))
            MADE_FILES.labels(claim.format, "refused" if problem.type in ERRORS else "failed").inc()
            return
        content, media_type = made, exporter_of(claim.format).media_type
        kept = await _in_thread(
            lambda: keep_made(self._engine, self._store, claim, content, media_type, quota=self._quota)
        )
        if kept:
            MADE_FILES.labels(claim.format, "made").inc()

    async def _renew(self) -> None:
        """Renew the claims of this process while it has any."""
        while self._making:
            await asyncio.sleep(RENEW_SECONDS)
            tokens = [claim.token for claim in self._making]
            with suppress(Unreachable):
                await _in_thread(lambda: renew_makings(self._engine, tokens))  # noqa: B023 - awaited at once


async def _in_thread(call: Callable[[], Found]) -> Found:
    return await to_thread.run_sync(call)


def _error(problem: FailureReason) -> MareyError:
    kind = ERRORS.get(problem.type, MareyError)
    return kind(problem.message, where=problem.where, hint=problem.hint)
