"""How a region grows: a state machine that decides what is computed next and computes nothing heavy itself."""
