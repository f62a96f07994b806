"""Database migrations (Alembic). `marey.jobs.upgrade` runs them; `marey admin migrate` calls that."""
