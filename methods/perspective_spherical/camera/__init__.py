"""The perspective grid for the camera's rays."""
