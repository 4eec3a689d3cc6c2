"""Code shared by methods: the triangle test, hit points, binning."""
