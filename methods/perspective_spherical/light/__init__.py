"""The spherical grid for the shadow rays of one light."""
