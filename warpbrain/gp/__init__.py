"""The generative model of tissue: what the literature says about strain energy, and what can be learnt from it."""
