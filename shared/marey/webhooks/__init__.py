"""What a webhook may be, how its messages look and how its secret is kept; for the API and for the scheduler."""
