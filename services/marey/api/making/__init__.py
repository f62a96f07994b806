"""Files of stored motions that are made on request, in child processes."""
