"""What is right: the Embree reference, the exact referee, classes of answers, and scores."""
