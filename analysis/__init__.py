"""Everything after the recording: files and arrays in, files and arrays out."""
