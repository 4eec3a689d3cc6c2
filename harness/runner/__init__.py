"""What happens in a run: from an experiment to points, worker processes, timing and records."""
