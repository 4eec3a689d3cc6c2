"""What is kept: records, journals, statistics, and folders of results."""
