"""One ray per pixel through any structure: kernels, their launches, the starts of float32 shadow rays."""
