"""Adapters: a host's types to arrays and back. Each is imported on its own and needs only its host."""
