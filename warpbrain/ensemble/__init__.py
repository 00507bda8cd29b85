"""Many runs: parameter sets on one mesh as one batched simulation, on one device or over many workers."""
