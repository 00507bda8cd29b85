"""The still figures of a diagnosis."""
