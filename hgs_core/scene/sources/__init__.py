"""Where scenes come from, one file a kind."""
