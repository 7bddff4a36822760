"""What is wrong on this machine before an incident, in plain words, and what to do about it."""
