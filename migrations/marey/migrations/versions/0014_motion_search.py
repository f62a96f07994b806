"""One narrow table that motions are listed and searched by, kept by triggers: every release's writes reach it.

Motions that are there are copied first, while others work on. Only then the table of motions is locked, what changed
meanwhile is copied too, and the triggers come.
"""

import time

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None

ATTEMPTS = 20
PAUSE_SECONDS = 0.2

TABLE = """
    CREATE TABLE motion_search (
        motion_id UUID NOT NULL,
        job_id UUID NOT NULL,
        created_at TIMESTAMPTZ NOT NULL,
        tenant_id TEXT NOT NULL,
        terms TSVECTOR NOT NULL,
        CONSTRAINT pk_motion_search PRIMARY KEY (motion_id)
    );

    -- Words of the prompt as they are; everything else behind chr(1), which no word begins with.
    CREATE FUNCTION motion_terms(
        tenant TEXT, job UUID, number INTEGER, name TEXT, tags TEXT[], review TEXT, prompt TEXT
    ) RETURNS TSVECTOR LANGUAGE sql IMMUTABLE PARALLEL SAFE AS $$
        SELECT to_tsvector('english'::regconfig, prompt) || array_to_tsvector(
            ARRAY[
                chr(1) || 't' || tenant,
                chr(1) || 'j' || job::text,
                chr(1) || 'x' || number::text,
                chr(1) || 'r' || coalesce(review, 'new')
            ]
            || CASE WHEN name IS NULL THEN '{}'::text[] ELSE ARRAY[chr(1) || 'n' || lower(name)] END
            || CASE WHEN tags = '{}' THEN '{}'::text[]
                    ELSE ARRAY(SELECT chr(1) || 'g' || tag FROM unnest(tags) AS tag WHERE tag IS NOT NULL) END
        )
    $$;
"""

COPY = """
    INSERT INTO motion_search (motion_id, job_id, created_at, tenant_id, terms)
    SELECT motion.id, motion.job_id, motion.created_at, motion.tenant_id,
           motion_terms(motion.tenant_id, motion.job_id, item.index, item.name, item.tags, motion.review, item.prompt)
    FROM motion JOIN item ON item.id = motion.item_id
"""

INDEXES = """
    CREATE INDEX ix_motion_search_created ON motion_search (tenant_id, created_at, motion_id);
    CREATE INDEX ix_motion_search_job ON motion_search (job_id, created_at, motion_id);
    CREATE INDEX ix_motion_search_terms ON motion_search USING gin (terms) WITH (gin_pending_list_limit = 512);
"""

# What began to be written before the copy was made is not in it.
CATCH_UP = f"""
    DELETE FROM motion_search WHERE NOT EXISTS (SELECT FROM motion WHERE motion.id = motion_search.motion_id);
    {COPY}
    WHERE motion.id IN (
        SELECT id FROM motion WHERE age(xmin) <= age('{{since}}'::xid)
        UNION SELECT motion.id FROM motion JOIN item ON item.id = item_id WHERE age(item.xmin) <= age('{{since}}'::xid)
    )
    ON CONFLICT (motion_id) DO UPDATE SET terms = excluded.terms WHERE motion_search.terms <> excluded.terms;
"""  # noqa: S608 - of constants alone

# Plans of these statements outlive the table's statistics: they are told to go by index.
TRIGGERS = f"""
    CREATE FUNCTION motion_search_insert() RETURNS trigger LANGUAGE plpgsql
        SET enable_seqscan = off SET enable_hashjoin = off SET enable_mergejoin = off AS $$
    BEGIN
        {COPY.replace("FROM motion JOIN", "FROM made AS motion JOIN")}
        ON CONFLICT (motion_id) DO UPDATE SET terms = excluded.terms;
        RETURN NULL;
    END $$;
    CREATE TRIGGER motion_search_insert AFTER INSERT ON motion REFERENCING NEW TABLE AS made
        FOR EACH STATEMENT EXECUTE FUNCTION motion_search_insert();

    CREATE FUNCTION motion_search_delete() RETURNS trigger LANGUAGE plpgsql
        SET enable_seqscan = off SET enable_hashjoin = off SET enable_mergejoin = off AS $$
    BEGIN
        DELETE FROM motion_search USING gone WHERE motion_search.motion_id = gone.id;
        RETURN NULL;
    END $$;
    CREATE TRIGGER motion_search_delete AFTER DELETE ON motion REFERENCING OLD TABLE AS gone
        FOR EACH STATEMENT EXECUTE FUNCTION motion_search_delete();

    CREATE FUNCTION motion_search_truncate() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        TRUNCATE motion_search;
        RETURN NULL;
    END $$;
    CREATE TRIGGER motion_search_truncate AFTER TRUNCATE ON motion
        FOR EACH STATEMENT EXECUTE FUNCTION motion_search_truncate();

    CREATE FUNCTION motion_search_update() RETURNS trigger LANGUAGE plpgsql SET enable_seqscan = off AS $$
    BEGIN
        IF TG_TABLE_NAME = 'motion' THEN
            UPDATE motion_search
            SET terms = motion_terms(
                NEW.tenant_id, NEW.job_id, item.index, item.name, item.tags, NEW.review, item.prompt
            ), created_at = NEW.created_at
            FROM item WHERE item.id = NEW.item_id AND motion_search.motion_id = NEW.id;
        ELSE
            UPDATE motion_search
            SET terms = motion_terms(
                motion.tenant_id, motion.job_id, NEW.index, NEW.name, NEW.tags, motion.review, NEW.prompt
            )
            FROM motion WHERE motion.item_id = NEW.id AND motion_search.motion_id = motion.id;
        END IF;
        RETURN NULL;
    END $$;
    CREATE TRIGGER motion_search_review AFTER UPDATE OF review, created_at ON motion FOR EACH ROW
        WHEN (OLD.review IS DISTINCT FROM NEW.review OR OLD.created_at <> NEW.created_at)
        EXECUTE FUNCTION motion_search_update();
    CREATE TRIGGER motion_search_item AFTER UPDATE OF prompt, name, tags, index ON item FOR EACH ROW
        WHEN (
            OLD.prompt <> NEW.prompt OR OLD.name IS DISTINCT FROM NEW.name
            OR OLD.tags <> NEW.tags OR OLD.index <> NEW.index
        )
        EXECUTE FUNCTION motion_search_update();
"""  # noqa: S608 - of constants alone

# Where replication or a bulk load switches triggers off, these still run: no other code writes the table.
ALWAYS = """
    ALTER TABLE motion
        ENABLE ALWAYS TRIGGER motion_search_insert,
        ENABLE ALWAYS TRIGGER motion_search_delete,
        ENABLE ALWAYS TRIGGER motion_search_truncate,
        ENABLE ALWAYS TRIGGER motion_search_review;
    ALTER TABLE item ENABLE ALWAYS TRIGGER motion_search_item;
"""

DOWN = """
    DROP TRIGGER motion_search_item ON item;
    DROP TRIGGER motion_search_review ON motion;
    DROP TRIGGER motion_search_truncate ON motion;
    DROP TRIGGER motion_search_delete ON motion;
    DROP TRIGGER motion_search_insert ON motion;
    DROP FUNCTION motion_search_update, motion_search_truncate, motion_search_delete, motion_search_insert;
    DROP TABLE motion_search;
    DROP FUNCTION motion_terms;
"""


def upgrade() -> None:
    op.execute(TABLE)
    conn = op.get_bind()
    since = conn.execute(sa.text("SELECT pg_snapshot_xmin(pg_current_snapshot())::xid::text")).scalar_one()
    op.execute(COPY)
    op.execute(INDEXES)
    _lock(conn)
    op.execute(CATCH_UP.format(since=int(since)))
    op.execute(TRIGGERS)
    op.execute(ALWAYS)


def _lock(conn: sa.Connection) -> None:
    """Keep others from writing motions and items until the end.

    Others lock the two in either order. Each attempt gives up, and lets go of both, before Postgres looks for
    deadlocks (after 1 s): so it never cancels a worker's commit.
    """
    timeout = conn.execute(sa.text("SELECT current_setting('lock_timeout')")).scalar_one()
    for attempt in range(ATTEMPTS):
        try:
            with conn.begin_nested():
                conn.execute(sa.text("SET LOCAL lock_timeout = '500ms'"))
                conn.execute(sa.text("LOCK TABLE motion, item IN SHARE ROW EXCLUSIVE MODE"))
            break
        except sa.exc.OperationalError:
            if attempt + 1 == ATTEMPTS:
                raise
            time.sleep(PAUSE_SECONDS)
    conn.execute(sa.text("SELECT set_config('lock_timeout', :timeout, true)"), {"timeout": timeout})


def downgrade() -> None:
    op.execute(DOWN)
