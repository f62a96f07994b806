"""What workers do for the command line: the only package of `services` that imports `workers`, and only when asked."""
