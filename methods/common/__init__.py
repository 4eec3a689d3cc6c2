"""What methods share: the triangle test, hit points, binning."""
