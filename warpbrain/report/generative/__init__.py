"""Pictures and tables of the generative model of tissue."""
