"""FEBio's test problems: read from its input files, kept in a neutral form, and solved with warpbrain."""
