"""Doors to other systems: what they are told of an incident, and what they say back."""
