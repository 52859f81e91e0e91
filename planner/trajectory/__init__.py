"""A trajectory between two configurations is planned here, through certified regions; what is returned is proved to be in them."""
