"""What ``dap-node`` does, one module for what belongs together."""
