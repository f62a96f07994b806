"""The HTTP API. One folder per noun: routes, schemas, service."""
