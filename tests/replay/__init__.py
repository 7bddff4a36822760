"""Recordings played back give the same answers."""
