"""The machine that measures: its facts for the record, and its lock."""
