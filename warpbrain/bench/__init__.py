"""`python -m warpbrain.bench`: the time of each phase of a step beside the paper's Table 3, and that of batches."""
