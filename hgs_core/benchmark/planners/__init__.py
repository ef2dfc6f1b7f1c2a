"""Planners compared on a grid of missions: run, resumed, tabulated and drawn (`hgs bench planners`)."""
