"""Real recordings through the fusion: strides of real boots, readings of real radio."""
