"""The machine that measures: its facts for the record, its lock, and whose turn it is to take samples."""
