"""Published strain energies of brain tissue: 73 studies as data, their energies, and the points that they make."""
