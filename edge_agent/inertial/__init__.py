"""Stance, strapdown and heading: the mathematics of a moving boot."""
