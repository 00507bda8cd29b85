"""What a simulation left out: where it and the recordings differ, which physics would explain it, and whether it does."""
