"""Worker processes: the run's side (pool, handle), the worker's (executor, grader), and what lies between them."""
