"""Quality of a motion: what is physically wrong with it, measured against real motions.

`record.py` is the schema that API, files and pages share; `measure.py` measures, `limits.py` judges.
"""
