"""The vocabulary: the actions that Marey knows, the words for them, and which of them a prompt names.

Standard library only: the small client imports it.
"""
