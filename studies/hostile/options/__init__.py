"""Lines of the command line, read and checked without the library's parser."""
