"""The live loop of a worker: streams from Postgres and Redis, through a session pool, frame by frame to Redis."""
