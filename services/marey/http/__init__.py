"""HTTP infrastructure that the API and the text service share."""
