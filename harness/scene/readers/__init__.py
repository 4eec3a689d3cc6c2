"""Readers of scene files, one format a file."""
