"""What of a region's proof holds in a changed scene is found here; nothing here decides whether a proof holds."""
