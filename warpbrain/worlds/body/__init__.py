"""A body that was recorded while it deformed."""
