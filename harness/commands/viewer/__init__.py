"""The live page of ``shadowbench view``: frames on demand, a server on the loopback address, and the page itself."""
