"""Tissue parameters from observed deformation: likelihood, estimate, and what the data can tell."""
