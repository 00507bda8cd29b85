"""Talking with a person at a terminal: progress, interruption, a quiet start."""
