"""Live streams and their sockets."""
