"""One folder a method. A method never times, never scores and never reads the exact reference."""
