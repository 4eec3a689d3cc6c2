"""The instrument: scenes, the contract of a method, timing, truth, scoring, records. It never names a method."""
