"""A building's plan: its file, its images, and what a page draws of it."""
