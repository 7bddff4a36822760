"""Where signal strengths come from."""
