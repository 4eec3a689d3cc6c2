"""The cube around a light: where it is aimed, its faces and cells, and what a triangle covers of them."""
