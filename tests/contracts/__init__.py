"""The surfaces that other programs see, recorded: a change of one is a decision, never an accident.

`recorded/` holds one file a surface. A test compares each with what the code says today; after a wanted change
`python -m tests.contracts` writes them again, and the difference belongs in the commit and in the change log.
"""
