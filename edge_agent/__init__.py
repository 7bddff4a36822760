"""Worn by a responder: reads the boot IMU, tells movement."""
