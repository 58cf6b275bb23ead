"""The `face` command, its pictures and its window."""
