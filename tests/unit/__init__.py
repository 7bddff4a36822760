"""One function or type at a time."""
