"""Fuses, records, replays, shows."""
