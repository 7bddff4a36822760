"""What ``command-post`` does, one module a command."""
