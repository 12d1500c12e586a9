"""What is learned of another program's loads: a correction of ours that is fitted to its series under a few of the same winds."""
