"""Building blocks without a model, a database or a network: errors, settings, hashing, text and file checks."""
