"""The items of a request: prompts, their settings and checks. Standard library only, because the client imports it."""
