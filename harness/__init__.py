"""The benchmark harness: scenes, the interface of a method, timing, the reference, scoring, records, reports."""
