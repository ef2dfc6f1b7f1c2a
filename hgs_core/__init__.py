"""Active scene reconstruction with 3D Gaussian splatting: maps, gains, planners, simulation, missions."""

__version__ = "0.1.0"
