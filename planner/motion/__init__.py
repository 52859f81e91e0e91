"""These modules prove that every point of a motion is in certified regions."""
