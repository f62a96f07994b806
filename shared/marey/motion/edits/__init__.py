"""Operations on finished motions: cut, join, loop, mirror, retime, smooth. `marey.motion.edit` applies them.

`table.py` declares every operation with its parameters, once for Python, JSON and the command line; the file of each
operation computes it. A new operation is a file and an entry of the table.
"""
