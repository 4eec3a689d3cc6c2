"""What a method sees of one moment and fills: the contract, passes, the session, and the effects."""
