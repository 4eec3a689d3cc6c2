"""The rays of a light: their hit points, what they cover, receivers, and how they are sorted into cells."""
