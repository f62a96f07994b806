"""Training data: archives in, a prepared folder out, and the reader that training uses."""
