"""Conversion of a tenant's rigs to records of a backup, and back. The caller chooses where they are kept."""

from __future__ import annotations

from typing import Annotated, Any

import sqlalchemy as sa
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, field_validator
from sqlalchemy import exc

from marey.core.errors import InvalidFile, Unreachable
from marey.db.database import transaction
from marey.db.deadlines import BACKUP
from marey.db.ids import new_id
from marey.jobs import tables
from marey.motion.export_options import REFERENCE_RIGS, RIG_NAME
from marey.takes.assets import ContentStore, keep_content, write_content
from marey.takes.made import ATTEMPTS
from marey.takes.rigs import MEDIA_TYPE, lock_rigs, rigs_query


class RigRecord(BaseModel):
    """A rig without the content of its file; fields as of `RigRow`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: Annotated[str, Field(pattern=f"^{RIG_NAME}$")]
    version: int = Field(ge=1)
    format: Annotated[str, Field(pattern=r"^[a-z0-9]{1,16}$")]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    size: int = Field(ge=0)
    map: dict[str, str | None] | None
    report: dict[str, Any]
    added_by: str
    created: AwareDatetime
    updated: AwareDatetime

    @field_validator("name")
    @classmethod
    def _no_reference(cls, name: str) -> str:
        if name in REFERENCE_RIGS:
            raise ValueError("is the name of a reference rig")
        return name


def back_up_rigs(conn: sa.Connection, tenant: str) -> list[RigRecord]:
    """Return the rigs of a tenant, oldest first."""
    table = tables.rig.c
    rows = conn.execute(rigs_query().where(table.tenant_id == tenant).order_by(table.created_at, table.id)).mappings()
    return [RigRecord.model_validate({name: row[name] for name in RigRecord.model_fields}) for row in rows]


def restore_rig(engine: sa.Engine, store: ContentStore, tenant: str, record: RigRecord, data: bytes) -> bool:
    """Restore a rig with its file; return False if the tenant has a rig of the name, which stays as it is.

    Quotas and the limit of rigs are not checked, as for restored jobs.

    Args:
        data: the file; its hash was checked.

    Raises:
        InvalidFile: the database refuses it.
        Unreachable: the store or the database does not answer.
    """
    for _ in range(ATTEMPTS):
        with transaction(engine, BACKUP) as conn:
            if _is_there(conn, tenant, record.name):
                return False
        write_content(engine, store, tenant, data, MEDIA_TYPE)
        try:
            with transaction(engine, BACKUP) as conn:
                lock_rigs(conn, tenant)
                if _is_there(conn, tenant, record.name):
                    return False
                asset = keep_content(conn, tenant, record.sha256)
                if asset is None:
                    continue
                conn.execute(
                    sa.insert(tables.rig).values(id=new_id(), tenant_id=tenant, **_row(record), asset_id=asset)
                )
        except exc.DataError as error:
            reason = (str(error.orig).splitlines() or ["?"])[0]
            raise InvalidFile(f"the database refuses it: {reason}", where=f"rig {record.name}") from error
        return True
    raise Unreachable("garbage collection removed the same new file several times", where="store")


def _is_there(conn: sa.Connection, tenant: str, name: str) -> bool:
    table = tables.rig.c
    found = sa.select(sa.func.count()).where(table.tenant_id == tenant, table.name == name)
    return bool(conn.execute(found).scalar_one())


def _row(record: RigRecord) -> dict[str, Any]:
    return {
        "name": record.name,
        "version": record.version,
        "format": record.format,
        "map": sa.null() if record.map is None else record.map,
        "report": record.report,
        "added_by": record.added_by,
        "created_at": record.created,
        "updated_at": record.updated,
    }
