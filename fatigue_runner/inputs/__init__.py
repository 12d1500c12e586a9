"""What is read: files as plain data that remembers its lines, sections with typed keys, sweeps; and whole files written.

A file is read by `source.read_mapping`, checked by a `section.Section` (`section.validated`): one sentence with
file, line, key and the way out, the same for every kind of file.
"""
