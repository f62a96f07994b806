"""Invariants of the tables of jobs, for state machines and chaos runs."""

from __future__ import annotations

import sqlalchemy as sa

CHECKS = {
    "counters are not those of the items": """
        SELECT job.id, job.total, count(item.id) FROM job LEFT JOIN item ON item.job_id = job.id GROUP BY job.id
        HAVING (job.total, job.ready, job.leased, job.succeeded, job.failed, job.dead, job.cancelled) <>
          (count(item.id), count(*) FILTER (WHERE item.state = 'ready'), count(*) FILTER (WHERE item.state = 'leased'),
           count(*) FILTER (WHERE item.state = 'succeeded'), count(*) FILTER (WHERE item.state = 'failed'),
           count(*) FILTER (WHERE item.state = 'dead'), count(*) FILTER (WHERE item.state = 'cancelled'))
    """,
    "a lane does not count its claimable items": """
        SELECT * FROM
          (SELECT job_id, queue, batch_key,
                  count(*) FILTER (WHERE NOT solo) AS ready, count(*) FILTER (WHERE solo) AS solo
           FROM item WHERE state = 'ready' AND run_after IS NULL GROUP BY job_id, queue, batch_key) AS items
          FULL JOIN (SELECT * FROM lane WHERE ready + solo > 0) AS lane USING (job_id, queue, batch_key)
        WHERE (items.ready, items.solo) IS DISTINCT FROM (lane.ready, lane.solo)
    """,
    "an item is in the queue of another stage": """
        SELECT id, stage, queue, batch_key FROM item
        WHERE stage = 'generate' AND (queue, batch_key) <> (model, generate_batch_key)
           OR (stage = 'text') <> (queue = 'text')
    """,
    "a lease holds nothing": """
        SELECT * FROM lease WHERE NOT EXISTS (SELECT FROM item WHERE item.lease_token = lease.token)
    """,
    "a lease holds items of another job or queue": """
        SELECT item.id, lease.token FROM item JOIN lease ON lease.token = item.lease_token
        WHERE (item.job_id, item.queue) <> (lease.job_id, lease.queue)
    """,
    "a solo lease holds several items, or a solo item has company": """
        SELECT lease.token, count(*) FROM lease JOIN item ON item.lease_token = lease.token GROUP BY lease.token
        HAVING bool_or(item.solo) AND count(*) > 1 OR bool_or(item.solo) <> lease.solo
    """,
    "a succeeded item has not one motion": """
        SELECT item.id, item.state, count(motion.id) FROM item LEFT JOIN motion ON motion.item_id = item.id
        WHERE item.queue <> 'evaluator' GROUP BY
          item.id HAVING count(motion.id) <> CASE WHEN item.state = 'succeeded' THEN 1 ELSE 0 END
    """,
    "a tenant has more queued or running than it may": """
        SELECT tenant.id, sum(job.ready + job.leased), sum(job.leased) FROM tenant JOIN job ON job.tenant_id = tenant.id
        GROUP BY tenant.id HAVING sum(job.ready + job.leased) > max_queued OR sum(job.leased) > max_running
    """,
    "a job goes on though more of it failed than it allows": """
        SELECT id, failed, dead, total, fail_early FROM job
        WHERE failed + dead > fail_early * total AND ready + leased > 0
    """,
    "a motion is found by other terms than its own": """
        WITH made AS (
            SELECT motion.id, motion.job_id, motion.created_at, motion.tenant_id,
                   motion_terms(motion.tenant_id, motion.job_id, item.index, item.name, item.tags, motion.review,
                                item.prompt) AS terms
            FROM motion JOIN item ON item.id = motion.item_id
        )
        (SELECT * FROM made EXCEPT SELECT motion_id, job_id, created_at, tenant_id, terms FROM motion_search)
        UNION ALL
        (SELECT motion_id, job_id, created_at, tenant_id, terms FROM motion_search EXCEPT SELECT * FROM made)
    """,
    "a motion's file is not stored": """
        SELECT motion_file.motion_id, asset.sha256 FROM motion_file JOIN asset ON asset.id = motion_file.asset_id
        WHERE asset.state <> 'stored'
    """,
    "a file made on request is not stored": """
        SELECT made_file.motion_id, asset.sha256 FROM made_file JOIN asset ON asset.id = made_file.asset_id
        WHERE asset.state <> 'stored' OR asset.size <> made_file.size OR asset.tenant_id <> made_file.tenant_id
    """,
    "a rig is not stored": """
        SELECT rig.name, asset.sha256 FROM rig JOIN asset ON asset.id = rig.asset_id
        WHERE asset.state <> 'stored' OR asset.tenant_id <> rig.tenant_id
    """,
    "a generated item has no text features": """
        SELECT item.id FROM item
        WHERE stage = 'generate' AND text_key <> ''
          AND NOT EXISTS (SELECT FROM text_features WHERE text_features.key = item.text_key)
    """,
    "an evaluation is done without a stored report, or has one and is not": """
        SELECT evaluation.id, evaluation.state, count(asset.id) FROM evaluation
        LEFT JOIN evaluation_report ON evaluation_report.evaluation_id = evaluation.id
        LEFT JOIN asset ON asset.id = evaluation_report.asset_id AND asset.state = 'stored'
        GROUP BY evaluation.id HAVING (evaluation.state = 'done') <> (count(asset.id) > 0)
    """,
    "a score succeeded and its evaluation is not done, or the other way round": """
        SELECT evaluation.id, evaluation.state, job.state FROM evaluation JOIN job ON job.id = evaluation.score_job_id
        WHERE (evaluation.state = 'done') <> (job.state = 'succeeded')
    """,
    "an evaluation is in a state that no event of its tells": """
        SELECT evaluation.id, evaluation.state FROM evaluation WHERE NOT EXISTS
          (SELECT FROM evaluation_event AS event WHERE event.evaluation_id = evaluation.id
           AND (event.state, event.reason) = (evaluation.state, evaluation.reason))
    """,
    "events have gaps": """
        SELECT job.id, job.event_seq, count(job_event.seq), max(job_event.seq)
        FROM job LEFT JOIN job_event ON job_event.job_id = job.id GROUP BY job.id
        HAVING job.event_seq <> count(job_event.seq) OR job.event_seq <> max(job_event.seq)
    """,
    "the last event tells another state than the job": """
        SELECT job.id, job.state, job_event.data FROM job JOIN job_event ON job_event.job_id = job.id
        WHERE seq = event_seq AND job_event.data ->> 'state' <> job.state
    """,
    "a webhook is not told each end and pause of a job once": """
        SELECT webhook.id, job.id FROM webhook JOIN job USING (tenant_id)
        WHERE webhook.events @> ARRAY['job.ended', 'job.paused'] AND webhook.created_at < job.created_at
          AND ARRAY(SELECT data ->> 'to' FROM job_event WHERE job_event.job_id = job.id AND kind = 'state'
                    AND data ->> 'to' NOT IN ('queued', 'running') ORDER BY seq)
            <> ARRAY(SELECT event.data ->> 'state' FROM webhook_event AS event
                     JOIN webhook_delivery AS delivery ON delivery.event_id = event.id
                     WHERE delivery.webhook_id = webhook.id AND event.data ->> 'job' = job.id::text
                       AND event.kind LIKE 'job.%' ORDER BY event.id)
    """,
    "a job has ended without its time, or runs with one": """
        SELECT id, state, finished_at FROM job WHERE (finished_at IS NULL) <> (ready + leased > 0)
    """,
}


def audit(conn: sa.Connection) -> list[str]:
    """Violated invariants, a line each; empty if all is well."""
    return [
        f"{what}: {tuple(row)}" for what, query in CHECKS.items() for row in conn.execute(sa.text(query)).fetchmany(5)
    ]
