"""Training of the role labeller `light`."""
