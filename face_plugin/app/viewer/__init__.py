"""The window of `face view`."""
