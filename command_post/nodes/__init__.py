"""What is known of each node beside its place: how fresh, its clock, what it has left (pure)."""
