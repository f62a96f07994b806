"""Counts of the quality of a job's motions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from uuid import UUID

import sqlalchemy as sa

COUNT = sa.text("""
    WITH record AS MATERIALIZED (
        SELECT metadata -> 'quality' AS quality FROM motion
        WHERE job_id = :job AND jsonb_typeof(metadata -> 'quality') = 'object'
    )
    SELECT NULL AS flag, count(*) AS motions, count(*) FILTER (WHERE (quality -> 'ok') = 'true') AS ok FROM record
    UNION ALL
    SELECT flag, count(*), 0 FROM record, jsonb_array_elements_text(quality -> 'flags') AS flag GROUP BY flag
""")


@dataclass(frozen=True)
class QualityCounts:
    """Motions of a job by their quality.

    Attributes:
        measured: motions with a quality record.
        ok: of these, those without a flag.
        flags: motions with each flag.
    """

    measured: int
    ok: int
    flags: Mapping[str, int]


def count_quality(conn: sa.Connection, job: UUID) -> QualityCounts:
    """Count the motions of a job by their quality; a job that does not exist has none."""
    rows = conn.execute(COUNT, {"job": job}).all()
    total = next(row for row in rows if row.flag is None)
    return QualityCounts(total.motions, total.ok, {row.flag: row.motions for row in rows if row.flag is not None})
