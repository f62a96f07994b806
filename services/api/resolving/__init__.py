"""What the short references of a person stand for."""
