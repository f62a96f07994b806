"""Alembic's environment: runs on the connection that `marey.db.migrate` hands over."""

from alembic import context

from marey.migrations.tables import metadata

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=metadata,
    compare_server_default=True,
    transaction_per_migration=False,
)
with context.begin_transaction():
    context.run_migrations()
