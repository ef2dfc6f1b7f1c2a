"""Planners to compare with: the same maps, grid, paths and memory of views, and a choice of its own each."""
