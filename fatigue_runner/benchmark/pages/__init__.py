"""What is told of the measurements: Markdown for the terminal and for docs/, figures, tables."""
