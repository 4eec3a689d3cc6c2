"""One folder a method. A method never times, never scores and never reads truth."""
