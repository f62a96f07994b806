"""Pictures and pages of motions: contact sheets, players, galleries."""
