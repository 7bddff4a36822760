"""The commander's page: what is shown (pure), who may see and do what, and the server."""
