"""The HTTP API. One folder a noun: routes, schemas, service."""
