"""What lies between the incident and its commanders: alerts, orders, answers (pure)."""
