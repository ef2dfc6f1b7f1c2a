"""One planner, one gain, one scene source and one sensor, as another package brings them."""
