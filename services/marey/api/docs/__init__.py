"""Docs: the API's reference as a page, from files of this package alone."""
