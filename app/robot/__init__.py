"""The reference robot: a simulated body with a camera, in a program of its own that obeys the service."""
