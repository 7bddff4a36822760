"""How the sensor is worn: samples in, odometry increments out."""
