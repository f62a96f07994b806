"""The live loop of a worker: streams from Postgres and Redis, through a pool of sessions, frame by frame to Redis."""
