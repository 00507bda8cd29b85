"""What a diagnosis prints and writes."""
