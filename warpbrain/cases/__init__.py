"""The case folder, and the cases that ship with the package."""
