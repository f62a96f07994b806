"""Jobs: submit, list, follow, steer."""
