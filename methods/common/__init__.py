"""Code shared by methods: boxes, binning, pixels, passes."""
