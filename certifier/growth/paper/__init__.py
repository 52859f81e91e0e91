"""The papers' algorithm grows a region here: C-IRIS' Algorithm 1 with the contractions of its appendix B.4.

The rest of :mod:`certifier.growth` does without this room. Only its machine and its options lead here.
"""
