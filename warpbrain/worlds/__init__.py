"""What recordings are of: each world gives residuals, nuisances and causes to one model of inference."""
