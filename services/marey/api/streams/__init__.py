"""Live streams and the sockets that show them."""
