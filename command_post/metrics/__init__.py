"""What the post counts of its own work, for those who watch it."""
