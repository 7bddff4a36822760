"""Pure mathematics: angles, rotations, statistics."""
