"""The particle filter and what it knows of movement and radio."""
