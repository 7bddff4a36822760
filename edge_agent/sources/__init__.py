"""Where inertial samples come from."""
