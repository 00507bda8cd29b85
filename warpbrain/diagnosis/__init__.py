"""What a simulation left out: where it and the recordings differ, what would explain it, and whether it does."""
