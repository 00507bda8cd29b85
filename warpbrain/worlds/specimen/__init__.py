"""A specimen in a testing machine."""
