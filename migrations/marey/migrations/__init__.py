"""Database migrations (Alembic). `shared.jobs.upgrade` runs them; `marey admin migrate` calls that."""
