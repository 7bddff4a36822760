"""What ``edge-agent`` does, one module a command."""
