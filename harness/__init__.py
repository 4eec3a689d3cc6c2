"""The benchmark harness: scenes, the interface of a method, timing, the exact reference, scoring, records, reports."""
