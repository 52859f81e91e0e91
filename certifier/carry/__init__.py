"""This package finds which parts of a region's proof hold in a changed scene; it does not decide whether a proof holds."""
