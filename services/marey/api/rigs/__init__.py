"""Rigs: characters of a tenant that motions are put on."""
