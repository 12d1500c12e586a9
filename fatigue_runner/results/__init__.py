"""What came out: the results table with its columns, its files, how accurate it is, and which integrator wins.

Plain rows, `{column: value}`; whoever shows them (report, viewer, command line) reads them here and runs nothing.
"""

from fatigue_runner.results.table import Results, read_results

__all__ = ["Results", "read_results"]
