"""The line of each normal, from the points themselves."""
