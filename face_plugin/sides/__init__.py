"""On which side of each point is free space."""
