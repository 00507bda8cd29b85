"""Simulates the deformation of the brain, on CPU and GPU from one source, and says what it left out."""

__version__ = "0.1.0"
