"""How a post that was killed goes on: from its state, or from what it had told last."""
