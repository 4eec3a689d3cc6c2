"""Timing a method and counting its memory, and nothing else: a change here makes every record out of date."""
