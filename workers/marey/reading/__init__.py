"""Training of the reader of actions (`marey.text.action_reader`): its texts, and the fit."""
