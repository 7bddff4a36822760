"""What every transport keeps, and what only a network can break."""
