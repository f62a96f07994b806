"""Database migrations (Alembic). `marey.db.upgrade` runs them; `marey admin migrate` calls that."""
