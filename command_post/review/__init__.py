"""What a recording shows afterwards: the incident at any moment of it, fused anew, and exported."""
