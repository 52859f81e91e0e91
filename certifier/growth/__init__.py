"""Growing a region is decided here: a state machine says what is computed next, and computes nothing heavy itself."""
