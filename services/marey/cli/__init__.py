"""`marey`, the command line. Importing it costs no torch, no server library and under 0.3 s."""
