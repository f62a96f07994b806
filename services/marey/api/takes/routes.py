"""`/v1/motions`."""

from __future__ import annotations

import unicodedata
from typing import Annotated, Any
from uuid import UUID

from fastapi import APIRouter, Depends, Path, Query, Response
from fastapi.concurrency import run_in_threadpool
from pydantic import Field

from marey import db, jobs
from marey import takes as takes_store
from marey.api.audit import note
from marey.api.auth import Reader, Submitter
from marey.api.context import Connection, Shared, deadline
from marey.api.files import CHECKED, FILE_RESPONSES, FOR_EVER, FileRequest, FileView, file_response
from marey.api.making.maker import FileOrder
from marey.api.making.query import GivenOptions, Rate, WantedBody, WantedRig
from marey.api.takes.files import (
    MAKING_RESPONSES,
    being_made,
    motion_and_rig,
    recipe,
    rig_header,
    source_of,
    stored_file,
)
from marey.api.takes.packs import FORMAT, NewPackBody, pack_response, packed_files
from marey.api.takes.schemas import (
    MotionDetailView,
    MotionView,
    NewRerollBody,
    NewReviewBody,
    RerollsView,
    RerollView,
    ReviewFilter,
)
from marey.api.takes.service import file_stem, made_again
from marey.core.disposition import download_name
from marey.exporters import extension_of
from marey.http.json_bodies import UniqueKeysRoute
from marey.http.problems import RESPONSES
from marey.http.schemas import Cursor, FreeText, Limit, PageView
from marey.items.values import MAX_NAME, MAX_TAG_LENGTH, MAX_TAGS

router = APIRouter(prefix="/v1/motions", tags=["motions"], responses=RESPONSES, route_class=UniqueKeysRoute)


def motion_filter(
    tag: Annotated[
        list[Annotated[str, Field(min_length=1, max_length=MAX_TAG_LENGTH), FreeText()]] | None,
        Query(max_length=MAX_TAGS, description="A tag as it was given, such as `shot=010`; several: all of them."),
    ] = None,
    name: Annotated[
        Annotated[str, Field(min_length=1, max_length=MAX_NAME), FreeText()] | None,
        Query(description="Prefix of the name."),
    ] = None,
    text: Annotated[
        Annotated[str, Field(min_length=1, max_length=500), FreeText(lines=True)] | None,
        Query(description='Words of the prompt in any form; `"a phrase"`, `or`, `-not`.'),
    ] = None,
    review: Annotated[list[ReviewFilter] | None, Query(description="One of these review states.")] = None,
) -> takes_store.MotionFilter:
    """Filters of a motion listing; all given ones must match."""
    chosen_reviews = review or []
    return takes_store.MotionFilter(
        tags=tag or (),
        name=name and unicodedata.normalize("NFC", name),  # as stored names and prompts
        text=text and unicodedata.normalize("NFC", text),
        reviews=[jobs.Review(each) for each in chosen_reviews if each is not ReviewFilter.NEW],
        unreviewed=ReviewFilter.NEW in chosen_reviews,
    )


Found = Annotated[takes_store.MotionFilter, Depends(motion_filter)]


@router.get("")
@deadline(db.SEARCH)
def list_motions(
    conn: Connection,
    key: Reader,
    found: Found,
    job: Annotated[UUID | None, Query(description="Of this job, in the order they were made.")] = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> PageView[MotionView]:
    """List motions that match all filters, newest first."""
    page = takes_store.list_motions(conn, key.tenant, job=job, found=found, cursor=cursor, limit=limit)
    return PageView[MotionView].of(page, MotionView.of)


@router.post("/review")
def review_motions(body: NewReviewBody, conn: Connection, key: Submitter) -> list[MotionView]:
    """Keep or reject motions, all or none; idempotent. Returns them in the order given."""
    verdict = None if body.verdict is None else jobs.Review(body.verdict)
    rows = takes_store.review(conn, key.tenant, body.motions, verdict, by=key.name, comment=body.comment)
    note(conn, key, "motion.review", rows[0].id, verdict=verdict, motions=len(rows))
    return [MotionView.of(row) for row in rows]


@router.post("/reroll", status_code=202)
@deadline(db.BULK)
def reroll_motions(body: NewRerollBody, conn: Connection, shared: Shared, key: Submitter) -> RerollsView:
    """Make motions again with the next seeds, all or none: new items in their jobs, linked to the motions they replace.

    A motion has at most one re-roll: a repeated request returns the same one. To continue, re-roll that take.
    """
    takes = takes_store.reroll(
        conn,
        key.tenant,
        body.motions,
        lambda item: made_again(item, shared.catalogue),
        by=key.name,
        comment=body.comment,
    )
    note(conn, key, "motion.reroll", body.motions[0], motions=len(takes))
    return RerollsView(items=[RerollView.of(take) for take in takes])


PACK_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"content": {"application/x-tar": {"schema": {"type": "string", "format": "binary"}}}},
}


@router.post("/files", response_class=Response, responses=PACK_RESPONSES)
async def get_files(body: NewPackBody, shared: Shared, key: Reader) -> Response:
    """Get stored files of many motions as a tar, each as `<motion>.<format>`.

    In the order given, at most 64 MiB together; the server sends them itself, without a redirect. A file whose content
    is lost is left out.
    """
    files = await run_in_threadpool(packed_files, shared, key.tenant, body)
    return pack_response(shared, key.tenant, files)


@router.get("/{motion}")
def get_motion(motion: UUID, conn: Connection, key: Reader) -> MotionDetailView:
    """Get one motion, with the graph and settings it was made from."""
    return MotionDetailView.of(jobs.get_motion(conn, key.tenant, motion))


@router.head("/{motion}/files/{format}", include_in_schema=False)
@router.get("/{motion}/files/{format}", response_class=Response, responses={**FILE_RESPONSES, **MAKING_RESPONSES})
async def get_file(
    motion: UUID,
    format: Annotated[str, Path(pattern=FORMAT, description="`npz`, `bvh`, `glb`, `mp4`, …")],
    shared: Shared,
    key: Reader,
    part: FileRequest,
    options: GivenOptions,
    fps: Rate = None,
    rig: WantedRig = None,
    body: WantedBody = None,
) -> Response:
    """Get a file of a motion; its ETag is its SHA-256.

    A file in a format that was not stored, or with a rate or options of its own, is made on request and kept for a
    while; 202 if that takes longer than 5 s: ask again.
    """
    row, own_rig = await run_in_threadpool(motion_and_rig, shared, key.tenant, motion, rig=rig, body=body)
    file = stored_file(row, wanted := recipe(row, format, {**options, "rig": rig, "body": body}, fps, own_rig))
    caching = FOR_EVER if file is not None else CHECKED
    if file is None:
        file = await shared.maker.get(FileOrder(key, motion, source_of(row), wanted, own_rig))
    if file is None:
        return being_made(format)
    name, view = download_name(file_stem(row), extension_of(format)), FileView(**vars(file))
    answer = await run_in_threadpool(file_response, shared, key.tenant, name, view, part, caching=caching)
    if own_rig is not None:
        answer.headers.update(rig_header(own_rig))
    return answer
