"""What the user reads: files and figures made from results. Computes nothing."""
