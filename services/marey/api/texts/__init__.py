"""Parsing of prompts, by the text service."""
