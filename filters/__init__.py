"""Steps of a filter chain, free of any host."""
