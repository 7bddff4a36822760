"""Scenarios run offline, many of them at once, and what is shown of how they went."""
