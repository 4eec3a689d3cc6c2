"""A frame as a method sees it: the interface of a method, its input arrays and answers, passes and the session."""
