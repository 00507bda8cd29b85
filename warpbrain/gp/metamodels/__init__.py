"""Meta-models: laws of one or two parameters, fitted to curves of strain energy."""
