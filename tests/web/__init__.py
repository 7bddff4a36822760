"""The commander's page: what it is told, who may do what, and how it looks in a real browser."""
