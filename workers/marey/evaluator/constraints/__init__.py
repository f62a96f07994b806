"""How well constrained motions meet their constraints, and what that costs: `marey eval constraints`."""
