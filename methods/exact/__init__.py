"""What makes float32 tests exact, once for all methods."""
