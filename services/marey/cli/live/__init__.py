"""What `marey stream` is made of: the socket, the lines somebody types, the counter, the file that grows."""
