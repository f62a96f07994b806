"""Resolution of short references to ids."""
