"""When what runs: passes, which of them a frame needs, the captured graph, threads of a CPU."""
