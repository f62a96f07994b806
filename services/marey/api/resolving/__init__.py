"""Resolve short references, as a person types them, to ids."""
