"""How fast, and beside whom. Run with ``--benchmark-enable``."""
