"""The pages of docs/mechanisms, from the registry and from what was measured: they say what the code does."""
