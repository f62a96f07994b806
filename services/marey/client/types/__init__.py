"""Results of the API as frozen dataclasses, with the API's field names; a module for each noun.

A client works with servers that are one release older or newer: fields of a newer server stand in `raw` alone, and
fields that an older server does not send have their defaults. States are strings, because a newer server may have more.
"""
