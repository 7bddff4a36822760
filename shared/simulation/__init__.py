"""Building, walkers, boots and radio: what the real world does, seeded."""
