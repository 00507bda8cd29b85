"""Published strain energies of brain tissue: 73 studies as data (`studies.toml`), their forms, and what they make."""
