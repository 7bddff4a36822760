"""The team's joint smoother, and the tracker that keeps it up to date."""
