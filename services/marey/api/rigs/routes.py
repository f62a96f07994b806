"""`/v1/rigs`."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from marey import takes
from marey.api.audit import note
from marey.api.auth import Operator, Reader, Submitter
from marey.api.context import Connection, Shared
from marey.api.rigs import service
from marey.api.rigs.schemas import RigDetailView, RigFormat, RigMap, RigName, RigPath, RigView
from marey.db import transaction
from marey.http.bodies import kept_body
from marey.http.problems import RESPONSES
from marey.http.schemas import Cursor, Limit, PageView

router = APIRouter(prefix="/v1/rigs", tags=["rigs"], responses=RESPONSES)
FILE_BODY = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.post(
    "",
    status_code=201,
    openapi_extra=FILE_BODY,
    responses={200: {"model": RigDetailView, "description": "The rig is there already with this file and map"}},
)
async def add_rig(
    request: Request,
    response: Response,
    shared: Shared,
    key: Submitter,
    name: RigName,
    format: RigFormat,
    map: RigMap = None,
) -> RigDetailView:
    """Add a rig: the file is the body. The same file and map under a name change nothing; others are a new version.

    The answer says which joints were found; a file without legs is refused, and `map` names the joints.
    """
    async with kept_body(request, shared, key.tenant) as body:
        added = await service.add(shared, key, name, format, map, body)
    response.status_code = 201 if added.changed else 200
    response.headers["Location"] = f"/v1/rigs/{name}"
    return RigDetailView.of(added.rig)


@router.get("")
def list_rigs(conn: Connection, key: Reader, cursor: Cursor = None, limit: Limit = 50) -> PageView[RigView]:
    """List rigs, newest first; the reference rigs are not among them."""
    page = takes.list_rigs(conn, key.tenant, cursor=cursor, limit=limit)
    return PageView[RigView].of(page, RigView.of)


@router.get("/{rig}")
def get_rig(rig: RigPath, conn: Connection, key: Reader) -> RigDetailView:
    """Get one rig, with what is found in it."""
    return RigDetailView.of(takes.get_rig(conn, key.tenant, rig))


@router.delete("/{rig}", status_code=204)
def remove_rig(rig: RigPath, shared: Shared, key: Operator) -> None:
    """Remove a rig, and the files that were made on it."""
    with transaction(shared.engine) as conn:
        asset = takes.remove_rig(conn, key.tenant, rig)
        note(conn, key, "rig.remove", rig)
    takes.remove_assets(shared.engine, shared.store, [asset])
