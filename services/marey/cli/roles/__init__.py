"""Work of workers in the process of a command: the only package of `services` that imports `workers`, lazily."""
