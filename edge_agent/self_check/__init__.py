"""What is wrong with the sensor, found in its samples and said so that it can be mended. Pure."""
