"""The first characters of names, found by index: a prefix of many names is one entry instead of one for each name."""

from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None

# COST: reading an index of 300,000 motions is cheaper than calling this for some thousand.
FUNCTION = """
    CREATE FUNCTION motion_name_prefixes(terms TSVECTOR) RETURNS TEXT[]
        LANGUAGE sql IMMUTABLE PARALLEL SAFE COST 10000 AS $$
        SELECT array_agg(substr(term, 3, size))
        FROM unnest(tsvector_to_array(terms)) AS term, generate_series(1, least(length(term) - 2, 32)) AS size
        WHERE starts_with(term, chr(1) || 'n')
    $$;
"""
# One index of both, which intersects all conditions of a filter; it serves what the index of the terms alone did.
INDEX = """
    CREATE INDEX ix_motion_search_filters ON motion_search USING gin (terms, motion_name_prefixes(terms))
        WITH (gin_pending_list_limit = 512);
    DROP INDEX ix_motion_search_terms;
"""
DOWN = """
    CREATE INDEX ix_motion_search_terms ON motion_search USING gin (terms) WITH (gin_pending_list_limit = 512);
    DROP INDEX ix_motion_search_filters;
    DROP FUNCTION motion_name_prefixes;
"""


def upgrade() -> None:
    op.execute(FUNCTION)
    op.execute(INDEX)


def downgrade() -> None:
    op.execute(DOWN)
