"""Shots: motion that a model generates around other motion. Edits by a model, timelines of prompts, constraints."""
