"""What would follow: a model pre-processed for a device, its equilibrium and its motion."""
