"""What is to be measured: experiments, options, points and their keys, the order of rounds, the time that it takes."""
