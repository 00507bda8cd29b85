"""What was observed: recordings, their files, and how a simulated state is compared with them."""
