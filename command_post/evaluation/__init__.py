"""How far tracks and DAPs are from the truth: in one run, and over many (pure)."""
