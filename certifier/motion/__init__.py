"""A motion is certified here: pair by pair, a plane for each interval of its time. Bounds on the bodies' acceleration do the rest."""
