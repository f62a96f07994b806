"""Poses of a standing body, changed by hand: limbs, bones of constant length, arms and trunk that move along paths."""
