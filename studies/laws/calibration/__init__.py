"""Laws from curves of tests: bands, inverse fits, two tests of one fabric."""
