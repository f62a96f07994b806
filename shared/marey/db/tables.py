"""Column types, metadata and constraints that all tables share."""

from __future__ import annotations

from collections.abc import Iterable

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import TIMESTAMP, UUID

metadata = sa.MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)

Time = TIMESTAMP(timezone=True)
Id = UUID(as_uuid=True)
NOW = sa.text("now()")


def one_of(column: str, values: Iterable[str]) -> str:
    """Return the condition that a column holds one of some values."""
    return f"{column} IN ({', '.join(repr(str(value)) for value in values)})"


def short_id(column: str = "id") -> sa.ColumnElement[str]:
    """Return the last eight digits of an id, as its index has them."""
    return sa.literal_column(f'"right"({column}::text, 8)', sa.Text)
